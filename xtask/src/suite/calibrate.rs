//! Finds what a case's numbers are to be: amplitudes that are as strong as it aims at, the strength that they have, and where they act.

use super::case::{Case, Put, Simulator, bins};
use super::magnet::Magnet;
use super::record::{Maker, observed};
use super::regions::{Moved, rms};
use super::strength::{self, Ruler};
use palpate::Error;
use std::path::Path;

/// How often a recording that cannot be simulated is tried with three tenths less of what it hides.
const WEAKER: usize = 3;

/// Most recordings of a search for an amplitude, the logarithm of the strength over the one aimed at that is close enough, and the largest
/// amplitude.
const WATCHED_TRIES: usize = 3;
/// See [`WATCHED_TRIES`].
const CLOSE: f64 = 0.35;
/// The same from which on an amplitude taken in proportion is searched for instead.
const FAR: f64 = 0.6;
/// See [`WATCHED_TRIES`].
const MOST: f64 = 12.0;

/// Three digits: a truth that can be copied.
fn round(x: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    let unit = 10f64.powi(2 - x.abs().log10().floor() as i32);
    (x * unit).round() / unit
}

impl Case {
    /// Takes amplitudes in proportion to those of the same effects where they are strong by themselves; false where one is not among them.
    fn scaled_from(&mut self, strong: &[Case]) -> bool {
        let found = |h: &Put| {
            let same = |c: &&Case| c.scene == self.scene && c.simulator == self.simulator && c.hidden.len() == 1;
            let c = strong.iter().filter(same).find(|c| c.hidden[0].what == h.what)?;
            let factor = (h.aim? / c.strength.filter(|s| *s > 0.0)?).min(1.0);
            h.amplitude.or(Some(round(factor * c.hidden[0].amplitude?)))
        };
        let all: Option<Vec<f64>> = self.hidden.iter().map(found).collect();
        let is_known = all.is_some();
        for (h, a) in self.hidden.iter_mut().zip(all.into_iter().flatten()) {
            h.amplitude = Some(a);
        }
        is_known
    }

    /// Measures strength and the bins in which it acts at known amplitudes.
    fn measure(&mut self, folder: &Path) -> Result<(), Error> {
        let setup = self.setup()?;
        let amplitudes = self.amplitudes()?;
        let moved = match self.simulator {
            Simulator::Tetrahedra => {
                strength::left(&self.watched(&setup, &self.change(&amplitudes)?.0, &folder.join("exact"), false, None)?)?
            }
            Simulator::Cells => {
                let hidden = self.hide(&setup.truth(false)?, &amplitudes)?.0;
                strength::left(&observed(&setup, &hidden, &Maker::own(), &folder.join("exact"), false)?)?
            }
        };
        self.strength = Some((100.0 * rms(&moved)).round() / 100.0);
        self.acts = Some(bins(&setup.truth(false)?).acts(&moved));
        Ok(())
    }

    /// Finds amplitudes, strength and the bins in which it acts, as far as they are not known.
    ///
    /// # Errors
    /// The scene cannot be simulated with it.
    pub fn calibrate(&mut self, folder: &Path, strong: &[Case]) -> Result<(), Error> {
        if self.hidden.is_empty() || self.strength.is_some() && self.acts.is_some() {
            return Ok(());
        }
        let stated: Vec<bool> = self.hidden.iter().map(|h| h.amplitude.is_some()).collect();
        if self.scaled_from(strong) {
            self.measure(folder)?;
            let off = self.hidden.iter().find_map(|h| h.aim).zip(self.strength).map_or(0.0, |(aim, s)| (s / aim).ln().abs());
            if self.hidden.len() > 1 || off < FAR {
                return self.weaken(folder);
            }
            // What sets in all at once does not grow in proportion.
            (self.strength, self.acts) = (None, None);
            self.hidden.iter_mut().zip(&stated).filter(|(_, s)| !**s).for_each(|(h, _)| h.amplitude = None);
        }
        if self.simulator == Simulator::Tetrahedra {
            return self.calibrate_watched(folder);
        }
        let setup = self.setup()?;
        let ruler = Ruler::new(&setup, &folder.join("ruler"))?;
        for k in 0..self.hidden.len() {
            if self.hidden[k].amplitude.is_none() {
                let put = self.hidden[k].clone();
                let aim = put.aim.ok_or_else(|| Error::Input(format!("case \"{}\" aims at no strength", self.name)))?;
                let found = match put.what.as_str() {
                    "magnet" => ruler.amplitude(aim, |s, a| {
                        s.effects = Magnet::near(&self.scene, a)?.apply(s)?.effects;
                        Ok(())
                    })?,
                    _ => {
                        let line = self.line(&put)?;
                        ruler.amplitude(aim, |s, a| line.apply(s, a).map(|_| ()))?
                    }
                };
                self.hidden[k].amplitude = Some(round(found));
            }
        }
        self.weaken(folder)
    }

    /// The same by recordings of the tetrahedra without noise.
    fn calibrate_watched(&mut self, folder: &Path) -> Result<(), Error> {
        let setup = self.setup()?;
        let aim = self.hidden.iter().filter_map(|h| h.aim).map(|a| a * a).sum::<f64>().sqrt();
        let stated: Option<Vec<f64>> = self.hidden.iter().map(|h| h.amplitude).collect();
        let mut a = 1.0;
        let mut best: Option<(f64, f64, Vec<Moved>)> = None;
        for _ in 0..WATCHED_TRIES {
            let amplitudes = stated.clone().unwrap_or_else(|| vec![round(a); self.hidden.len()]);
            let watched =
                self.change(&amplitudes).and_then(|(c, _)| self.watched(&setup, &c, &folder.join("exact"), false, None));
            match watched.and_then(|e| strength::left(&e)) {
                Ok(moved) => {
                    let s = rms(&moved).max(1e-6);
                    let off = (s / aim).ln().abs();
                    let next = (a * (aim / s).clamp(0.25, 4.0)).min(MOST);
                    if best.as_ref().is_none_or(|b| off < b.0) {
                        best = Some((off, a, moved));
                    }
                    if off < CLOSE || next == a || stated.is_some() {
                        break;
                    }
                    a = next;
                }
                // What no fit can follow, or no step solve, is too much.
                Err(e) if e.exit_code() == 1 => a *= 0.5,
                Err(e) => return Err(e),
            }
        }
        let (_, a, moved) = best.ok_or_else(|| Error::Failed("no amplitude can be recorded and fitted".into()))?;
        self.hidden.iter_mut().for_each(|h| h.amplitude = h.amplitude.or(Some(round(a))));
        self.strength = Some((100.0 * rms(&moved)).round() / 100.0);
        self.acts = Some(bins(&setup.truth(false)?).acts(&moved));
        Ok(())
    }

    /// What the method's own grid can simulate may be too much for a finer one: then everything is measured again at less.
    fn weaken(&mut self, folder: &Path) -> Result<(), Error> {
        for _ in 0..WEAKER {
            match self.record(folder) {
                Err(e) if e.exit_code() == 1 => {
                    self.hidden.iter_mut().filter_map(|h| h.amplitude.as_mut()).for_each(|a| *a = round(0.7 * *a));
                    self.strength = None;
                }
                Err(e) => return Err(e),
                Ok(_) if self.strength.is_none() => return self.measure(folder),
                Ok(_) => return Ok(()),
            }
        }
        self.record(folder)?;
        if self.strength.is_none() { self.measure(folder) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn amplitudes_have_three_digits() {
        assert_eq!([0.123456, -98765.0, 0.0].map(super::round), [0.123, -98800.0, 0.0]);
    }
}
