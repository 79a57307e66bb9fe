//! A round as an array of Slurm jobs, followed by a job that merges it and submits the next one.

use crate::error::FarmError;
use crate::folder::FarmFolder;
use crate::state::{Round, SlurmJobs};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Array jobs have at most this many tasks, unless a cluster allows more (`MaxArraySize`, 1001 by default).
const MAX_ARRAY: usize = 1000;

#[derive(Clone, Debug)]
pub struct Slurm {
    /// The `noisefloor` command, at a path that every node sees.
    pub program: PathBuf,
    /// More options for `sbatch`, such as `--partition=render`.
    pub options: Vec<String>,
}

impl Slurm {
    /// Most tasks that a round may have.
    pub fn most_tasks() -> usize {
        MAX_ARRAY
    }

    /// Submits the tasks of a round as an array, and the step that follows it whatever becomes of them.
    pub fn submit(&self, folder: &FarmFolder, round: &Round) -> Result<SlurmJobs, FarmError> {
        let (dir, number) = (folder.path(), round.number);
        let log = |name: &str| format!("--output={}/log/{number:04}-{name}.log", dir.display());
        let last = round.tasks.len().saturating_sub(1);
        let run = format!("farm task {} {number} \"$SLURM_ARRAY_TASK_ID\"", quote(dir));
        // What is lost with a node is planned again; a task that Slurm repeated would hold up the round
        let array =
            [format!("--array=0-{last}"), log("%a"), "--no-requeue".into(), "--signal=B:TERM@60".into()];
        let tasks = self.sbatch(&format!("noisefloor-{number}"), &array, &run)?;

        let options: String =
            self.options.iter().map(|option| format!(" --sbatch={}", quote(Path::new(option)))).collect();
        let run = format!("farm step {} {number}{options}", quote(dir));
        let after = [format!("--dependency=afterany:{tasks}"), log("step"), "--requeue".into()];
        let step = self.sbatch(&format!("noisefloor-{number}-merge"), &after, &run).inspect_err(|_| {
            // Without the step nobody would use them
            let _ = Command::new("scancel").arg(&tasks).output();
        })?;
        Ok(SlurmJobs { tasks, step })
    }

    /// Submits one job; its number.
    fn sbatch(&self, name: &str, options: &[String], run: &str) -> Result<String, FarmError> {
        let line = format!("exec {} {run}", quote(&self.program));
        let mut command = Command::new("sbatch");
        command
            .args(["--parsable", "--job-name", name])
            .args(&self.options)
            .args(options)
            .args(["--wrap", &line]);
        let said = output(command, "sbatch", "Slurm is not installed here; `--local N` renders without it")?;
        Ok(said.trim().split(';').next().unwrap_or_default().to_owned())
    }

    /// Jobs of a round that are waiting or running.
    pub fn left(jobs: &SlurmJobs) -> Result<usize, FarmError> {
        let mut command = Command::new("squeue");
        command.args([
            "--noheader",
            "--array",
            "--format=%A",
            "--jobs",
            &format!("{},{}", jobs.tasks, jobs.step),
        ]);
        match output(command, "squeue", "Slurm is not installed here") {
            Ok(said) => Ok(said.lines().filter(|line| !line.trim().is_empty()).count()),
            // Slurm forgets jobs some minutes after their end
            Err(FarmError::Program { what, .. }) if what.contains("Invalid job id") => Ok(0),
            Err(error) => Err(error),
        }
    }
}

/// Standard output of a program that must succeed.
fn output(mut command: Command, program: &str, absent: &str) -> Result<String, FarmError> {
    let failed = |what| FarmError::Program { program: program.to_owned(), what };
    let output = command.output().map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => failed(format!("is not on the path: {absent}")),
        _ => failed(format!("cannot be run: {error}")),
    })?;
    if !output.status.success() {
        return Err(failed(format!("failed: {}", String::from_utf8_lossy(&output.stderr).trim())));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A word of a shell's line.
fn quote(word: &Path) -> String {
    format!("'{}'", word.to_string_lossy().replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_reach_the_program_as_they_are() {
        assert_eq!(quote(Path::new("/a b/it's")), r"'/a b/it'\''s'");
    }
}
