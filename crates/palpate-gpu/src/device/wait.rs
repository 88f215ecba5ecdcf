//! Where this crate waits, and the only place that does (`tests/waits.rs`). What a device answers later is a future. A page in a browser awaits
//! it; here [`drive`] looks at the device until it has answered.
//!
//! Whoever looks at a device calls back all that wait for it, those of other threads included. So a look that came to its end says nothing of
//! one's own answer: another thread may have taken the callback and be about to make it.

use super::error::GpuError;
use super::gpu::Gpu;
use std::pin::{Pin, pin};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker};
use std::thread::{self, Thread};
use std::time::Duration;

/// Longest rest between two looks at a device whose callback another thread makes; that thread ends it earlier.
const REST: Duration = Duration::from_millis(1);

/// What a callback will bring; `None` where the device dropped it.
#[derive(Debug)]
pub(crate) struct Answer<T>(Arc<Mutex<Slot<T>>>);

/// A callback's end of an [`Answer`].
#[derive(Debug)]
pub(crate) struct Giver<T>(Arc<Mutex<Slot<T>>>);

#[derive(Debug)]
struct Slot<T> {
    value: Option<T>,
    closed: bool,
    waker: Option<Waker>,
}

/// Both ends of an answer.
pub(crate) fn answer<T>() -> (Giver<T>, Answer<T>) {
    let slot = Arc::new(Mutex::new(Slot { value: None, closed: false, waker: None }));
    (Giver(slot.clone()), Answer(slot))
}

fn locked<T>(slot: &Mutex<Slot<T>>) -> MutexGuard<'_, Slot<T>> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<T> Giver<T> {
    /// Answers.
    pub(crate) fn give(self, value: T) {
        locked(&self.0).value = Some(value);
    }
}

impl<T> Drop for Giver<T> {
    fn drop(&mut self) {
        let mut slot = locked(&self.0);
        slot.closed = true;
        let waker = slot.waker.take();
        drop(slot);
        waker.into_iter().for_each(Waker::wake);
    }
}

impl<T> Future for Answer<T> {
    type Output = Option<T>;

    fn poll(self: Pin<&mut Self>, cx: &mut Context) -> Poll<Option<T>> {
        let mut slot = locked(&self.0);
        if slot.closed {
            return Poll::Ready(slot.value.take());
        }
        slot.waker = Some(cx.waker().clone());
        Poll::Pending
    }
}

/// Wakes a thread that rests.
struct Rouse(Thread);

impl Wake for Rouse {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// Drives a future on this thread; `look` gives the device its turn.
///
/// # Errors
/// Those of a look.
fn drive<T>(future: impl Future<Output = T>, mut look: impl FnMut() -> Result<(), GpuError>) -> Result<T, GpuError> {
    let waker = Waker::from(Arc::new(Rouse(thread::current())));
    let mut future = pin!(future);
    loop {
        let mut ask = || future.as_mut().poll(&mut Context::from_waker(&waker));
        if let Poll::Ready(done) = ask() {
            return Ok(done);
        }
        let looked = look();
        if let Poll::Ready(done) = ask() {
            return Ok(done);
        }
        looked?;
        thread::park_timeout(REST);
    }
}

/// What a future gives that no open device is needed for: the system answers by itself.
pub(super) fn for_system<T>(future: impl Future<Output = T>) -> T {
    pollster::block_on(future)
}

/// What a future gives at once, if it does.
pub(super) fn now<T>(future: Pin<&mut (impl Future<Output = T> + ?Sized)>) -> Option<T> {
    match future.poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(done) => Some(done),
        Poll::Pending => None,
    }
}

/// A list of work that was handed over, to wait for its end.
#[derive(Debug)]
pub(crate) struct HandedOver {
    index: wgpu::SubmissionIndex,
    done: Answer<()>,
}

impl HandedOver {
    /// Until the device has done it. A device that was lost says so when its results are read.
    pub(crate) async fn done(self) {
        self.done.await;
    }
}

impl Gpu {
    /// Waits for a future of this device.
    ///
    /// # Errors
    /// The device is gone.
    pub(crate) fn wait_for<T>(&self, future: impl Future<Output = T>) -> Result<T, GpuError> {
        drive(future, || {
            let looked = self.device.poll(wgpu::PollType::wait_indefinitely());
            looked.map_err(|e| GpuError::Lost { reason: e.to_string() })?;
            // Whom a lost device has not called back by then it never will.
            let gone = self.lost.load(Ordering::SeqCst);
            if gone { Err(GpuError::Lost { reason: "the device did not answer".into() }) } else { Ok(()) }
        })
    }

    /// The same of one that may fail by itself.
    ///
    /// # Errors
    /// Its own, or what has gone wrong since the last read.
    pub(crate) fn waited<T>(&self, future: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
        self.wait_for(future).unwrap_or_else(|lost| Err(self.take_trouble().unwrap_or(lost)))
    }

    /// Waits for a list of work, not for those behind it. A device that was lost says so when its results are read.
    pub(crate) fn wait_until(&self, work: HandedOver) {
        // Its answer would come with that of the work which other threads have handed over since.
        let _ = self.device.poll(wgpu::PollType::Wait { submission_index: Some(work.index), timeout: None });
    }

    /// Gives the device its turn without waiting.
    pub(super) fn look(&self) {
        let _ = self.device.poll(wgpu::PollType::Poll);
    }

    /// Until everything that was handed over is done; `None` where the device dropped it.
    pub(crate) async fn done(&self) -> Option<()> {
        let (giver, answer) = answer();
        self.queue.on_submitted_work_done(move || giver.give(()));
        answer.await
    }

    /// The work handed over last, of this number, to wait for its end.
    pub(crate) fn handed_over(&self, index: wgpu::SubmissionIndex) -> HandedOver {
        let (giver, done) = answer();
        self.queue.on_submitted_work_done(move || giver.give(()));
        HandedOver { index, done }
    }

    /// Waits until everything handed to the device is done.
    ///
    /// # Errors
    /// The device is gone.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.waits.fetch_add(1, Ordering::Relaxed);
        self.wait_for(self.done()).map(|_| ())
    }
}
