//! Settings of the process and of its threads for runs that react in time: `eslvm run --realtime`.
//!
//! A thread that waits for a moment goes on late for three reasons. The system runs other threads first: a
//! priority prevents that. It wakes several sleepers at once: a small timer slack prevents that. And memory
//! that is touched for the first time, or that was paged out, is fetched first: locked memory prevents that.
//!
//! Each of these is a setting of the process, so that it is for programs to make, not for libraries. The
//! system may refuse it.
//!
//! Not here: systems other than Linux, which refuse all of it.

#![allow(unsafe_code)]

use std::hint::black_box;
use std::io;
#[cfg(all(target_os = "linux", not(miri)))]
use std::sync::atomic::{AtomicI32, Ordering};

/// Bytes of a page, the least that the systems have.
const PAGE: usize = 4096;

/// How much of the memory of the process is locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LockedMemory {
    /// All that it has, and all that it will have.
    All,
    /// The memory that it had at that time: the system limits locked memory to so many bytes.
    Present(u64),
}

/// The priority that threads take by [`join`]; 0 if there is none.
#[cfg(all(target_os = "linux", not(miri)))]
static PRIORITY: AtomicI32 = AtomicI32::new(0);

/// Touches so many bytes of the stack of this thread, so that its pages are there.
pub fn touch_stack(bytes: usize) {
    touch_pages(bytes.div_ceil(PAGE));
}

#[inline(never)]
fn touch_pages(left: usize) {
    let mut page = [0_u8; PAGE];
    black_box(&mut page);
    if left > 1 {
        touch_pages(left - 1);
    }
    black_box(&page);
}

#[cfg(all(target_os = "linux", not(miri)))]
mod system {
    use super::{LockedMemory, Ordering, PRIORITY, io};

    fn checked(result: libc::c_int) -> io::Result<()> {
        if result < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
    }

    /// Has the C library's allocator keep freed memory, and touches so many bytes, which it keeps too.
    pub fn keep_memory(bytes: usize) {
        /// Smaller than any block that the allocator would take from elsewhere.
        const PART: usize = 64 << 10;
        #[cfg(target_env = "gnu")]
        // SAFETY: these calls set a parameter each; the C library allows them at any time.
        unsafe {
            libc::mallopt(libc::M_MMAP_MAX, 0);
            libc::mallopt(libc::M_TRIM_THRESHOLD, i32::MAX);
        }
        let parts: Vec<Vec<u8>> = (0..bytes.div_ceil(PART)).map(|_| vec![1; PART]).collect();
        drop(std::hint::black_box(parts));
    }

    /// Locks the memory of the process, so that it is there whenever it is used.
    ///
    /// # Errors
    /// If the system does not permit it.
    pub fn lock_memory() -> io::Result<LockedMemory> {
        // SAFETY: these calls change no contents of memory. The probe maps memory that nothing else refers
        // to, and gives it back.
        unsafe {
            checked(libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE))?;
            let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
            checked(libc::getrlimit(libc::RLIMIT_MEMLOCK, &raw mut limit))?;
            let Ok(beyond) = usize::try_from(limit.rlim_cur) else { return Ok(LockedMemory::All) };
            if limit.rlim_cur == libc::RLIM_INFINITY {
                return Ok(LockedMemory::All);
            }
            // A process that may lock any amount has a limit too. Without that right, the system refuses
            // memory beyond the limit, so that an allocation would fail later.
            let probe = libc::mmap(
                std::ptr::null_mut(),
                beyond.max(1),
                libc::PROT_NONE,
                libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE,
                -1,
                0,
            );
            if probe != libc::MAP_FAILED {
                libc::munmap(probe, beyond.max(1));
                return Ok(LockedMemory::All);
            }
            checked(libc::munlockall())?;
            checked(libc::mlockall(libc::MCL_CURRENT))?;
            Ok(LockedMemory::Present(limit.rlim_cur))
        }
    }

    /// Gives this thread a priority from 1 to 99 before all threads that have none, and later those that
    /// [`join`]. Threads and programs that this one starts have none by themselves.
    ///
    /// # Errors
    /// If the system does not permit it.
    pub fn set_priority(priority: u8) -> io::Result<()> {
        set_own_priority(priority.into())?;
        PRIORITY.store(priority.into(), Ordering::Relaxed);
        Ok(())
    }

    fn set_own_priority(priority: i32) -> io::Result<()> {
        // SAFETY: the call reads the parameters, and changes nothing but the order in which threads run.
        // Zeros are valid parameters, of which some systems have more than this one.
        unsafe {
            let mut parameters: libc::sched_param = std::mem::zeroed();
            parameters.sched_priority = priority;
            let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
            checked(libc::sched_setscheduler(0, policy, &raw const parameters))
        }
    }

    /// Gives this thread the priority of the run, if there is one: for threads that a run waits for.
    pub fn join() {
        let priority = PRIORITY.load(Ordering::Relaxed);
        if priority > 0 {
            // The system has permitted it to the run.
            _ = set_own_priority(priority);
            set_timer_slack();
        }
    }

    /// Gives this thread the priority below that of the run, if there is one: for threads that work for a run
    /// beside it. Without a priority, such a thread could be stopped by others while it holds a lock that the
    /// run needs, such as one of the allocator or of the table of pages.
    pub fn join_below() {
        let priority = PRIORITY.load(Ordering::Relaxed);
        if priority > 0 {
            // As above.
            _ = set_own_priority((priority - 1).max(1));
        }
    }

    /// Has the timers of this thread end as precisely as the system can.
    pub fn set_timer_slack() {
        let slack: libc::c_ulong = 1;
        // SAFETY: the call changes nothing but how late the system may wake this thread.
        unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, slack) };
    }
}

#[cfg(not(all(target_os = "linux", not(miri))))]
mod system {
    use super::{LockedMemory, io};

    /// Does nothing on this system.
    pub fn keep_memory(_bytes: usize) {}

    /// Locks no memory on this system.
    ///
    /// # Errors
    /// Always.
    pub fn lock_memory() -> io::Result<LockedMemory> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Gives no priority on this system.
    ///
    /// # Errors
    /// Always.
    pub fn set_priority(_priority: u8) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Does nothing on this system.
    pub fn join() {}

    /// Does nothing on this system.
    pub fn join_below() {}

    /// Does nothing on this system.
    pub fn set_timer_slack() {}
}

pub use system::{join, join_below, keep_memory, lock_memory, set_priority, set_timer_slack};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_can_be_touched_and_a_thread_without_a_run_joins_nothing() {
        touch_stack(256 << 10);
        touch_stack(0);
        join();
        join_below();
    }

    #[test]
    #[cfg(all(target_os = "linux", not(miri)))]
    fn a_priority_is_of_one_thread_and_of_those_that_join() {
        let policy = || {
            // SAFETY: the call changes nothing.
            unsafe { libc::sched_getscheduler(0) }
        };
        let threads = std::thread::spawn(move || {
            if set_priority(1).is_err() {
                // The system does not permit it to this user.
                return;
            }
            assert_eq!(policy(), libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK);
            let started = std::thread::spawn(move || {
                assert_eq!(policy(), libc::SCHED_OTHER);
                join();
                assert_eq!(policy() & libc::SCHED_FIFO, libc::SCHED_FIFO);
            });
            started.join().expect("it does not panic");
            PRIORITY.store(0, Ordering::Relaxed);
        });
        threads.join().expect("it does not panic");
    }
}
