//! Takes the network away from this process.

/// Moves this process, which must have one thread, to a separate network without connections.
#[cfg(target_os = "linux")]
pub(crate) fn enter() -> Result<(), String> {
    use rustix::thread::{UnshareFlags, unshare_unsafe};
    let (user, group) = (rustix::process::getuid().as_raw(), rustix::process::getgid().as_raw());
    // SAFETY: the flags do not include the table of open files, which other threads could lose; there is one thread.
    unsafe { unshare_unsafe(UnshareFlags::NEWUSER | UnshareFlags::NEWNET | UnshareFlags::NEWIPC) }
        .map_err(|e| format!("the kernel does not allow this user namespaces: {e}"))?;
    // User and group keep their numbers inside; others do not exist there.
    for (file, text) in [
        ("/proc/self/setgroups", "deny".to_owned()),
        ("/proc/self/uid_map", format!("{user} {user} 1")),
        ("/proc/self/gid_map", format!("{group} {group} 1")),
    ] {
        std::fs::write(file, text).map_err(|e| format!("{file}: {e}"))?;
    }
    Ok(())
}

/// Other systems offer no equivalent to a process without privileges.
#[cfg(all(unix, not(target_os = "linux")))]
pub(crate) fn enter() -> Result<(), String> {
    Err("it needs Linux namespaces".into())
}
