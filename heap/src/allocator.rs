//! A setting of the C library's allocator, from which stacks, bignums and texts get their memory.
//!
//! The allocator of glibc gives a large block memory of its own, which the system has back when the block is
//! freed. But each time that happens, it raises the size from which on it does so, up to 32 MiB; smaller
//! blocks are cut out of one segment. The stacks of many tasks that grow side by side, and texts of integers
//! that get longer, leave holes there that nothing larger fits into: a process took twice the memory that it
//! used, far above `--memory`.

#![allow(unsafe_code)]

/// Size in bytes from which on a block has memory of its own.
#[cfg(all(target_os = "linux", target_env = "gnu", not(miri)))]
const LARGE: i32 = 128 << 10;

/// Bytes that the allocator keeps at the end of its segment: without that much, it would get them and give
/// them back again and again.
#[cfg(all(target_os = "linux", target_env = "gnu", not(miri)))]
const KEPT: i32 = 1 << 20;

/// Has the C library's allocator return large blocks to the system for good. It is a setting of the process,
/// so that it is for programs to call, not for libraries. Does nothing where that allocator is another.
pub fn return_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu", not(miri)))]
    // SAFETY: these calls set a parameter each; the C library allows them at any time. A value that it does
    // not like it ignores.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE);
        libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
    }
}
