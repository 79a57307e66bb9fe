//! A round in a few processes on this machine.

use crate::error::FarmError;
use crate::folder::FarmFolder;
use crate::state::Round;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// How often processes are looked after.
const PAUSE: Duration = Duration::from_millis(50);

/// Runs the tasks of a round, `processes` at a time, as `PROGRAM farm task DIR ROUND TASK`; returns those
/// that failed. Once `cancel` says so or one cannot be started, no more are started. Those that run are
/// waited for: a terminal's Ctrl-C reaches them as well, and they end with what they have.
pub fn run_local(
    program: &Path,
    folder: &FarmFolder,
    round: &Round,
    processes: usize,
    cancel: impl Fn() -> bool,
) -> Result<Vec<usize>, FarmError> {
    let (mut failed, mut running): (Vec<usize>, Vec<(usize, Child)>) = (Vec::new(), Vec::new());
    let (mut waiting, mut refused) = (0..round.tasks.len(), None);
    loop {
        while running.len() < processes.max(1) && refused.is_none() && !cancel() {
            let Some(task) = waiting.next() else { break };
            match start(program, folder, round.number, task, processes) {
                Ok(process) => running.push((task, process)),
                Err(error) => refused = Some(error),
            }
        }
        if running.is_empty() {
            return refused.map_or(Ok(failed), Err);
        }
        std::thread::sleep(PAUSE);
        let mut left = Vec::new();
        for (task, mut process) in running {
            match process.try_wait() {
                Ok(None) => left.push((task, process)),
                Ok(Some(status)) if status.success() => {}
                _ => failed.push(task),
            }
        }
        running = left;
    }
}

fn start(
    program: &Path,
    folder: &FarmFolder,
    round: usize,
    task: usize,
    processes: usize,
) -> Result<Child, FarmError> {
    let log = folder.log(round, task);
    let cannot_write = |fault: std::io::Error| FarmError::at(&log, fault);
    let said = File::create(&log).map_err(cannot_write)?;
    let also = said.try_clone().map_err(cannot_write)?;
    let mut command = Command::new(program);
    command.args(["farm", "task"]).arg(folder.path()).args([round.to_string(), task.to_string()]);
    if std::env::var_os("RAYON_NUM_THREADS").is_none() {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        command.env("RAYON_NUM_THREADS", cores.div_ceil(processes.max(1)).to_string());
    }
    let child = command.stdin(Stdio::null()).stdout(said).stderr(also).spawn();
    child.map_err(|error| FarmError::Program {
        program: program.display().to_string(),
        what: format!("cannot be started: {error}"),
    })
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Task;
    use std::os::unix::fs::PermissionsExt;

    /// Where the second cannot be started, the first is still waited for.
    #[test]
    fn nothing_runs_on_after_a_failure_to_start() {
        let scratch = tempfile::tempdir().unwrap();
        let program = scratch.path().join("program");
        std::fs::write(&program, "#!/bin/sh\n/bin/sleep 1\n: >\"$3/ended\"\n").unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let folder = FarmFolder::new(scratch.path());
        let task = || Task { frame: 0, batches: Vec::new() };
        let round = Round { number: 1, tasks: vec![task(), task()], ..Round::default() };
        // A folder where the log of the second would be
        std::fs::create_dir_all(folder.log(1, 1)).unwrap();
        let error = run_local(&program, &folder, &round, 2, || false).unwrap_err();
        assert!(matches!(&error, FarmError::Path { path, .. } if *path == folder.log(1, 1)), "{error}");
        assert!(scratch.path().join("ended").exists(), "a task still runs");
    }
}
