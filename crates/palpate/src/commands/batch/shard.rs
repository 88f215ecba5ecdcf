//! Which part of a batch one of several processes takes: by number, or by the task that a scheduler says it is.

use crate::error::Error;
use crate::results::batch::Shard;

/// Most shards: more than any scheduler starts tasks of one array.
const MOST: usize = 1_000_000;

/// What `--shard` may say.
const ALLOWED: &str =
    "must be K/N with K from 1 to N, as 2/3, or auto/N or auto, where a Slurm array or an indexed Kubernetes job says which";

/// What `--shard` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// This one.
    Given(Shard),
    /// The one that the scheduler says, of so many; `None`: of as many as the scheduler says.
    Scheduled(Option<usize>),
}

/// Reads the value of `--shard`.
pub fn parse(text: &str) -> Result<Asked, String> {
    let number = |digits: &str| -> Result<usize, String> {
        let plain = !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit());
        digits.parse().ok().filter(|n| plain && (1..=MOST).contains(n)).ok_or_else(|| ALLOWED.to_string())
    };
    match text.split_once('/') {
        None if text == "auto" => Ok(Asked::Scheduled(None)),
        None => Err(ALLOWED.into()),
        Some(("auto", of)) => Ok(Asked::Scheduled(Some(number(of)?))),
        Some((k, of)) => match (number(k)?, number(of)?) {
            (k, of) if k > of => Err(format!("there is no shard {k} of {of}; {ALLOWED}")),
            (number, of) => Ok(Asked::Given(Shard { number, of })),
        },
    }
}

/// Names of what schedulers say.
const SLURM: &str = "SLURM_ARRAY_TASK_ID";
const KUBERNETES: &str = "JOB_COMPLETION_INDEX";

impl Asked {
    /// The shard, in an environment with these variables.
    ///
    /// # Errors
    /// The scheduler does not say which one it is, or there is none like it.
    pub fn shard(self, variable: &dyn Fn(&str) -> Option<String>) -> Result<Shard, Error> {
        let of = match self {
            Asked::Given(shard) => return Ok(shard),
            Asked::Scheduled(of) => of,
        };
        let wrong = |message: String| Error::option("shard", of.map_or("auto".into(), |n| format!("auto/{n}")), message);
        let whole = |name: &str| -> Result<Option<usize>, Error> {
            let Some(text) = variable(name).filter(|t| !t.is_empty()) else { return Ok(None) };
            text.parse().map(Some).map_err(|_| wrong(format!("{name} is {text:?}; a whole number from 0 is expected")))
        };
        match (whole(SLURM)?, whole(KUBERNETES)?, of) {
            (Some(id), _, None) => {
                let told = |name: &str| {
                    let absent =
                        || wrong(format!("{SLURM} is set and {name} is not; say of how many shards with --shard auto/N"));
                    whole(name)?.ok_or_else(absent)
                };
                let (count, first, last) =
                    (told("SLURM_ARRAY_TASK_COUNT")?, told("SLURM_ARRAY_TASK_MIN")?, told("SLURM_ARRAY_TASK_MAX")?);
                let step = whole("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
                let even =
                    (first..=last).contains(&id) && (last - first) / step + 1 == count && (id - first).is_multiple_of(step);
                if !even || count > MOST {
                    return Err(wrong(format!(
                        "task {id} of an array of {count} from {first} to {last} has no place in an even row; submit with \
                         --array=1-N, or number the tasks from 1 to N and say --shard auto/N"
                    )));
                }
                Ok(Shard { number: (id - first) / step + 1, of: count })
            }
            (Some(id), _, Some(of)) if (1..=of).contains(&id) => Ok(Shard { number: id, of }),
            (Some(id), _, Some(of)) => Err(wrong(format!(
                "{SLURM} is {id}, and shards are numbered from 1 to {of}; submit with --array=1-{of}, or some of these"
            ))),
            (None, Some(index), Some(of)) if index < of => Ok(Shard { number: index + 1, of }),
            (None, Some(index), Some(of)) => Err(wrong(format!(
                "{KUBERNETES} is {index}, and that of {of} shards is from 0 to {}; N is the job's completions",
                of - 1
            ))),
            (None, Some(_), None) => {
                Err(wrong(format!("{KUBERNETES} does not say of how many; write --shard auto/N with N the job's completions")))
            }
            (None, None, _) => Err(wrong(format!(
                "neither {SLURM} nor {KUBERNETES} is set; outside of a Slurm array and an indexed Kubernetes job write --shard K/N"
            ))),
        }
    }
}

impl Shard {
    /// The shard that has the scene at this place of the list, from 0: scenes are dealt out like cards, so that neighbours, which are often
    /// alike, go to different shards.
    pub fn with(place: usize, of: usize) -> Shard {
        Shard { number: place % of + 1, of }
    }

    /// Places of its scenes in a list of so many.
    pub fn part(self, scenes: usize) -> Vec<usize> {
        (0..scenes).filter(|i| Shard::with(*i, self.of) == self).collect()
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_is_in_one_shard() {
        for (scenes, of) in [(0, 1), (3, 3), (10, 4), (2, 5), (7, 1)] {
            let mut all: Vec<usize> = (1..=of).flat_map(|number| Shard { number, of }.part(scenes)).collect();
            let most = (1..=of).map(|number| Shard { number, of }.part(scenes).len()).max();
            assert_eq!(most, Some(scenes.div_ceil(of)));
            all.sort_unstable();
            assert_eq!(all, (0..scenes).collect::<Vec<_>>());
        }
    }

    #[test]
    fn what_is_no_shard_is_told_what_is_allowed() {
        let given = |number, of| Ok(Asked::Given(Shard { number, of }));
        assert_eq!((parse("1/1"), parse("2/3"), parse("03/3")), (given(1, 1), given(2, 3), given(3, 3)));
        assert_eq!((parse("auto"), parse("auto/7")), (Ok(Asked::Scheduled(None)), Ok(Asked::Scheduled(Some(7)))));
        assert_eq!(parse("5/3"), Err(format!("there is no shard 5 of 3; {ALLOWED}")));
        for text in ["0/0", "0/3", "x", "", "/", "3/", "1/2/3", "-1/3", "+1/3", "1/auto", "auto/", "auto/0", "1/9999999", "1 /3"]
        {
            assert_eq!(parse(text), Err(ALLOWED.into()), "{text:?}");
        }
    }

    fn shard(text: &str, variables: &[(&str, &str)]) -> Result<[usize; 2], String> {
        let asked = parse(text).unwrap_or_else(|e| panic!("{e}"));
        let told = |name: &str| variables.iter().find(|v| v.0 == name).map(|v| v.1.to_string());
        asked.shard(&told).map(|s| [s.number, s.of]).map_err(|e| e.to_string())
    }

    /// The variables of one task of an array.
    fn slurm<'a>(id: &'a str, count: &'a str, min: &'a str, max: &'a str, step: &'a str) -> Vec<(&'static str, &'a str)> {
        vec![
            ("SLURM_ARRAY_TASK_ID", id),
            ("SLURM_ARRAY_TASK_COUNT", count),
            ("SLURM_ARRAY_TASK_MIN", min),
            ("SLURM_ARRAY_TASK_MAX", max),
            ("SLURM_ARRAY_TASK_STEP", step),
        ]
    }

    #[test]
    fn arrays_of_slurm_may_begin_anywhere_and_step() {
        assert_eq!(shard("auto", &slurm("1", "3", "1", "3", "1")), Ok([1, 3]));
        assert_eq!(shard("auto", &slurm("0", "3", "0", "2", "1")), Ok([1, 3]));
        assert_eq!(shard("auto", &slurm("8", "3", "0", "8", "4")), Ok([3, 3]));
        assert_eq!(shard("auto", &slurm("15", "3", "5", "17", "5")), Ok([3, 3]));
        // Task 2 of an array, submitted again alone.
        assert_eq!(shard("auto/3", &slurm("2", "1", "2", "2", "1")), Ok([2, 3]));
        // A list of tasks that are no even row.
        let e = shard("auto", &slurm("5", "3", "1", "7", "1")).expect_err("it has no number");
        assert!(
            e.starts_with("--shard auto: task 5 of an array of 3 from 1 to 7 has no place") && e.contains("--array=1-N"),
            "{e}"
        );
        let e = shard("auto/3", &slurm("0", "3", "0", "2", "1")).expect_err("there is none");
        assert!(e.starts_with("--shard auto/3: SLURM_ARRAY_TASK_ID is 0, and shards are numbered from 1 to 3"), "{e}");
        let e = shard("auto", &[("SLURM_ARRAY_TASK_ID", "1")]).expect_err("of how many?");
        assert!(e.contains("SLURM_ARRAY_TASK_COUNT is not; say of how many shards with --shard auto/N"), "{e}");
        let e = shard("auto", &[("SLURM_ARRAY_TASK_ID", "one")]).expect_err("no number");
        assert!(e.contains("SLURM_ARRAY_TASK_ID is \"one\""), "{e}");
    }

    #[test]
    fn indices_of_kubernetes_begin_at_zero_and_do_not_say_of_how_many() {
        let index = |text: &'static str| [("JOB_COMPLETION_INDEX", text)];
        assert_eq!((shard("auto/3", &index("0")), shard("auto/3", &index("2"))), (Ok([1, 3]), Ok([3, 3])));
        let e = shard("auto/3", &index("3")).expect_err("there is none");
        assert!(e.contains("JOB_COMPLETION_INDEX is 3, and that of 3 shards is from 0 to 2"), "{e}");
        let e = shard("auto", &index("1")).expect_err("of how many?");
        assert!(e.contains("write --shard auto/N with N the job's completions"), "{e}");
        let e = shard("auto", &[]).expect_err("nobody says");
        assert!(e.contains("neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set") && e.contains("--shard K/N"), "{e}");
    }
}
