//! Threads that compute on one device at the same time: each gets its own answers, its own errors, and the bits that it would get alone.

use super::forward::{Moment, states};
use super::scenes::{ball, device, held, own_device, plan, spread};
use crate::device::wait::answer;
use crate::device::{GpuError, Maker as _};
use crate::{Gpu, GpuBackend};
use palpate_engine::Evaluation;
use palpate_model::plan::Plan;
use std::sync::Barrier;
use std::thread;

/// Runs the same on so many threads at once.
fn on_threads<T: Send>(count: u32, work: impl Fn(u32) -> T + Sync) -> Vec<T> {
    let work = &work;
    thread::scope(|scope| {
        let all: Vec<_> = (0..count).map(|t| scope.spawn(move || work(t))).collect();
        all.into_iter().map(|t| t.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    })
}

/// A thread that looks at a device takes the callbacks of all that are ready. Before another has been called back its own look may be over:
/// where that was taken for "no answer", one read in 1500 of four threads on two cores failed. 16 000 of them would not pass.
#[test]
fn every_read_of_every_thread_is_answered_with_its_own() {
    let Some(gpu) = own_device() else { return };
    let failed = on_threads(4, |t| {
        let own = gpu.buffer("own", 4096).unwrap_or_else(|e| panic!("{e}"));
        let wrong = |k: &u32| {
            let number = t << 16 | k;
            gpu.queue.write_buffer(&own, 0, bytemuck::cast_slice(&[number; 1024]));
            gpu.download::<u32>(&own, 1024) != Ok(vec![number; 1024])
        };
        (0..4000).filter(wrong).count()
    });
    assert_eq!(failed, [0; 4]);
}

/// States of all steps, in bits, and what is read at the end.
type Course = (Vec<Vec<u64>>, Vec<Evaluation>);

fn course(backend: &GpuBackend, plan: &Plan) -> Course {
    let (states, evaluations) = states(backend, plan, &spread(plan, 2));
    let bits = |(u, v): &Moment| u.iter().chain(v).flat_map(|x| x.to_array()).map(f64::to_bits).collect::<Vec<_>>();
    (states.iter().map(|step| step.iter().flat_map(bits).collect()).collect(), evaluations)
}

/// Two of the threads compute the same, so that they also ask for the same kernels.
#[test]
fn threads_side_by_side_get_the_bits_of_one() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plans = [held(0.03), ball(0.03)].map(|scene| plan(&scene));
    let alone: Vec<Course> = plans.iter().map(|p| course(&backend, p)).collect();
    assert!(alone.iter().all(|a| a.1.iter().all(|e| e.failure.is_none())), "{:?}", alone[0].1);
    for round in 0..3 {
        let found = on_threads(3, |t| course(&backend.clone(), &plans[t as usize % 2]));
        for (t, (found, alone)) in found.iter().zip(alone.iter().cycle()).enumerate() {
            let first = found.0.iter().zip(&alone.0).position(|(a, b)| a != b);
            assert_eq!(first, None, "round {round}, thread {t}: the first step with other bits");
            assert_eq!(found.1, alone.1, "round {round}, thread {t}");
        }
    }
}

/// Asks for what a device refuses: a copy beyond the end of a buffer.
fn misuse(gpu: &Gpu) {
    let small = gpu.small();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("thread") });
    encoder.copy_buffer_to_buffer(&small, 0, &small, 1 << 20, 256);
    gpu.queue.submit([encoder.finish()]);
}

#[test]
fn an_error_is_read_by_the_thread_that_made_it() {
    let Some(gpu) = own_device() else { return };
    let (made, read) = (Barrier::new(2), Barrier::new(2));
    let found = on_threads(2, |t| {
        let own = gpu.buffer("own", 256).unwrap_or_else(|e| panic!("{e}"));
        if t == 1 {
            misuse(&gpu);
        }
        made.wait();
        // The innocent one reads first.
        let early = (t == 0).then(|| (gpu.troubled(), gpu.download::<u32>(&own, 1)));
        read.wait();
        early.unwrap_or_else(|| (gpu.troubled(), gpu.download::<u32>(&own, 1)))
    });
    assert_eq!(found[0], (false, Ok(vec![0])));
    assert!(found[1].0 && matches!(found[1].1, Err(GpuError::Refused { .. })), "{:?}", found[1]);
    assert_eq!(gpu.take_trouble(), None);
}

/// As in a browser, where a device does not say at once what it refuses.
#[test]
fn what_a_device_says_later_of_a_buffer_is_told_with_the_next_read() {
    let Some(gpu) = own_device() else { return };
    let own = gpu.buffer("own", 256).unwrap_or_else(|e| panic!("{e}"));
    let (well, none) = answer();
    let (bad, some) = answer();
    assert_eq!(gpu.caught(async { none.await.flatten() }), None);
    assert_eq!(gpu.caught(async { some.await.flatten() }), None);
    let late = GpuError::OutOfMemory { what: "the buffer `late`".into() };
    thread::scope(|scope| {
        scope.spawn(|| {
            well.give(None);
            bad.give(Some(late.clone()));
        });
        assert_eq!(gpu.download::<u32>(&own, 1), Err(late.clone()));
    });
    assert_eq!(gpu.download::<u32>(&own, 1), Ok(vec![0]));
    // A device that drops what it was to say has nothing to say.
    let (dropped, never) = answer::<Option<GpuError>>();
    drop(dropped);
    assert_eq!(gpu.caught(async { never.await.flatten() }), None);
}
