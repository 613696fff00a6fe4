//! Work off the interpreter's lock: other Python threads go on, Ctrl-C is heard, nothing panics into Python.
//!
//! | | for | how |
//! |---|---|---|
//! | [`here`] | what may take a microsecond | on the calling thread, which looks for signals every [`LOOK`] |
//! | [`beside`] | what calls Python itself | the same, and tells of progress |
//! | [`aside`] | what takes long, or several threads | on a thread of its own, while the calling one looks and tells of progress |
//! | [`apart`] | what also hears its stop late | the same, and left behind when a signal comes |

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::errors;

/// Between two looks for signals: well below the 50 ms that Ctrl-C may take.
pub const LOOK: Duration = Duration::from_millis(20);
/// Between two calls of a progress function.
const TELL: Duration = Duration::from_millis(50);

/// Watches over work on the calling thread. Any thread may ask it; the one that made it also looks.
pub struct Watch {
    began: Instant,
    /// When to look next, ns after `began`.
    next: AtomicU64,
    owner: ThreadId,
    stopped: AtomicBool,
    raised: Mutex<Option<PyErr>>,
}

impl Watch {
    fn new() -> Self {
        Self {
            began: Instant::now(),
            next: AtomicU64::new(LOOK.as_nanos() as u64),
            owner: thread::current().id(),
            stopped: AtomicBool::new(false),
            raised: Mutex::new(None),
        }
    }

    /// Whether to stop. Cheap enough to be asked in a loop.
    pub fn is_stopped(&self) -> bool {
        if self.stopped.load(Ordering::Relaxed) {
            return true;
        }
        let now = self.began.elapsed().as_nanos() as u64;
        if now < self.next.load(Ordering::Relaxed) || thread::current().id() != self.owner {
            return false;
        }
        self.next
            .store(now + LOOK.as_nanos() as u64, Ordering::Relaxed);
        // No interpreter any more: nobody waits for the answer.
        let raised = match Python::try_attach(|py| py.check_signals().err()) {
            Some(None) => return false,
            Some(raised) => raised,
            None => None,
        };
        if let Ok(mut place) = self.raised.lock() {
            *place = raised;
        }
        self.stopped.store(true, Ordering::Relaxed);
        true
    }

    fn into_raised(self) -> Option<PyErr> {
        self.raised.into_inner().unwrap_or(None)
    }
}

impl Watch {
    /// Calls `progress` with the share that is done; what it raises stops the work.
    fn tell(&self, progress: &Py<PyAny>, share: f64) {
        let told = Python::try_attach(|py| progress.call1(py, (share,)).map(drop));
        if let Some(Err(error)) = told {
            if let Ok(mut place) = self.raised.lock() {
                *place = Some(error);
            }
            self.stopped.store(true, Ordering::Relaxed);
        }
    }
}

/// [`here`] with a progress function, for work that itself calls Python: on the calling thread debuggers, context variables and
/// thread locals are what the caller's are. `work` is told whom to tell what share is done.
pub fn beside<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Watch, &mut dyn FnMut(f64)) -> T + Send,
) -> PyResult<T> {
    let by = progress.as_ref().map(|progress| progress.clone_ref(py));
    let result = here(py, move |watch| {
        let mut told = Instant::now();
        work(watch, &mut |share| {
            if let Some(progress) = &by
                && told.elapsed() >= TELL
            {
                told = Instant::now();
                watch.tell(progress, share.clamp(0.0, 1.0));
            }
        })
    })?;
    if let Some(progress) = &progress {
        progress.call1(py, (1.0,))?;
    }
    Ok(result)
}

/// Does `work` on this thread with the interpreter's lock released.
pub fn here<T: Send>(py: Python<'_>, work: impl FnOnce(&Watch) -> T + Send) -> PyResult<T> {
    let watch = Watch::new();
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| work(&watch))));
    if let Some(raised) = watch.into_raised() {
        return Err(raised);
    }
    result.map_err(|panic| broken(py, panic.as_ref()))
}

/// What a worker and the thread that waits for it share.
#[derive(Default)]
pub struct Shared {
    stopped: AtomicBool,
    /// Bits of a number from 0 to 1.
    done: AtomicU64,
}

impl Shared {
    /// Whether to stop.
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Says how much is done, from 0 to 1.
    pub fn set_done(&self, share: f64) {
        self.done
            .store(share.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    fn done(&self) -> f64 {
        f64::from_bits(self.done.load(Ordering::Relaxed))
    }
}

/// What a worker leaves: its result, or the panic that ended it.
type Left<T> = thread::Result<T>;

/// Does `work` on another thread. This one waits with the interpreter's lock released, looks for signals, and calls `progress`
/// with the share that is done. It returns when the work has ended, also where a signal came: so the work is asked to stop.
pub fn aside<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Shared) -> T + Send,
) -> PyResult<T> {
    let shared = Shared::default();
    let (left, raised) = py.detach(|| {
        thread::scope(|scope| {
            let (leave, left) = mpsc::channel();
            let shared = &shared;
            scope.spawn(move || {
                // Nobody may wait any more.
                let _ = leave.send(catch_unwind(AssertUnwindSafe(|| work(shared))));
            });
            wait(&left, shared, progress.as_ref(), true)
        })
    });
    conclude(py, left, raised, progress)
}

/// [`aside`] for work that owns all it needs and hears its stop late: where a signal comes this thread goes on at once, and the
/// work ends by itself a little later.
pub fn apart<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Shared) -> T + Send + 'static,
) -> PyResult<T> {
    let shared = Arc::new(Shared::default());
    let its = shared.clone();
    let (leave, left) = mpsc::channel();
    thread::Builder::new()
        .name("bikebot".into())
        .spawn(move || {
            let _ = leave.send(catch_unwind(AssertUnwindSafe(|| work(&its))));
        })
        .map_err(|error| pyo3::exceptions::PyOSError::new_err(error.to_string()))?;
    let (left, raised) = py.detach(|| {
        let left = left;
        wait(&left, &shared, progress.as_ref(), false)
    });
    conclude(py, left, raised, progress)
}

/// Waits for what the work leaves, looking for signals and telling of progress; where something is raised, until the work has
/// ended only if `patient`.
fn wait<T>(
    left: &Receiver<Left<T>>,
    shared: &Shared,
    progress: Option<&Py<PyAny>>,
    patient: bool,
) -> (Option<Left<T>>, Option<PyErr>) {
    let mut told = Instant::now();
    let mut raised = None;
    loop {
        match left.recv_timeout(LOOK) {
            Ok(result) => return (Some(result), raised),
            Err(RecvTimeoutError::Disconnected) => return (None, raised),
            Err(RecvTimeoutError::Timeout) if raised.is_some() => continue,
            Err(RecvTimeoutError::Timeout) => {}
        }
        let tell = progress.filter(|_| told.elapsed() >= TELL);
        let looked = Python::try_attach(|py| {
            py.check_signals()?;
            if let Some(progress) = tell {
                progress.call1(py, (shared.done(),))?;
            }
            PyResult::Ok(())
        });
        if tell.is_some() {
            told = Instant::now();
        }
        match looked {
            Some(Ok(())) => continue,
            Some(Err(error)) => raised = Some(error),
            // No interpreter any more: nobody waits for the result.
            None => {}
        }
        shared.stopped.store(true, Ordering::Relaxed);
        if !patient {
            return (None, raised);
        }
    }
}

fn conclude<T>(
    py: Python<'_>,
    left: Option<Left<T>>,
    raised: Option<PyErr>,
    progress: Option<Py<PyAny>>,
) -> PyResult<T> {
    if let Some(raised) = raised {
        return Err(raised);
    }
    let result = match left {
        Some(Ok(result)) => result,
        Some(Err(panic)) => return Err(broken(py, panic.as_ref())),
        None => return Err(errors::bikebot(py, "the work ended without a result")),
    };
    if let Some(progress) = &progress {
        progress.call1(py, (1.0,))?;
    }
    Ok(result)
}

/// A panic is a bug of ours: told as an exception, never thrown at the interpreter.
pub fn broken(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let what = panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".into());
    errors::bikebot(
        py,
        &format!("a bug in bikebot, please report it with what you called: {what}"),
    )
}
