//! What Linux says of a process, for tests of sources that start one.
#![cfg(target_os = "linux")]

/// Whether a process runs. One that has ended and waits for its parent to notice does not.
pub fn is_running(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    stat.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with(['Z', 'X']))
}

/// Resident memory of a running process in KiB.
///
/// # Panics
/// If there is no such process.
pub fn resident_kib(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"));
    let status = status.unwrap_or_else(|error| panic!("process {process}: {error}"));
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"));
    resident.and_then(|kib| kib.parse().ok()).unwrap_or_else(|| panic!("process {process} has ended"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn a_process_runs_and_holds_memory_until_it_ends() {
        let this = std::process::id();
        assert!(is_running(this));
        let held = std::hint::black_box(vec![1u8; 64 << 20]);
        assert!(resident_kib(this) > 64 << 10);
        drop(held);

        let mut child = Command::new("sleep").arg("1000").spawn().expect("sleep");
        assert!(is_running(child.id()));
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        assert!(!is_running(child.id()));
    }
}
