use crate::farm::{SCENE, assert_same, plan, render, shards};
use crate::kit::{command, json, stderr, text, wait_for};
use noisefloor_testkit::{Requirement, require};
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::{TempDir, tempdir};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm.sh");

/// A frame of one round, whose tasks take a second.
const LONG: &str = "glass-spheres --size 192x128 --tile 32 --batch 160 --max-spp 160 --threads 1";

/// A controller and two nodes on this machine, which end with it.
struct Cluster {
    folder: TempDir,
    conf: PathBuf,
}

impl Cluster {
    fn start() -> Option<Self> {
        let folder = tempdir().unwrap();
        let output = Command::new(SCRIPT).arg("start").arg(folder.path()).output();
        let found = match output {
            Ok(output) if output.status.success() => {
                let conf = String::from_utf8(output.stdout).unwrap().trim().into();
                Ok(Self { folder, conf })
            }
            Ok(output) => Err(format!("slurm.sh: {}", stderr(&output).trim().replace('\n', "; "))),
            Err(error) => Err(format!("slurm.sh cannot be run: {error}")),
        };
        require(Requirement::Slurm, found)
    }

    fn run(&self, program: &mut Command) -> String {
        let output = program.env("SLURM_CONF", &self.conf).output().unwrap();
        assert!(output.status.success(), "{program:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    }

    fn script(&self, args: &[&str]) {
        self.run(Command::new(SCRIPT).arg(args[0]).arg(self.folder.path()).args(&args[1..]));
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let _ = Command::new(SCRIPT).arg("stop").arg(self.folder.path()).status();
    }
}

/// A frame, during which a node loses its power, and a task writes rubbish; and a sequence of two frames: the
/// pictures are those of one machine.
#[test]
fn slurm_renders_what_one_machine_renders() {
    let Some(cluster) = Cluster::start() else { return };
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    render(&path("one"), LONG);
    plan(&path("frame"), &[], LONG);
    let wait = ["farm", "run", text(&path("frame")), "--wait", "--every", "0.2"].map(str::to_owned);
    let mut farm = command(&wait.each_ref().map(String::as_str));
    let farm = farm.env("SLURM_CONF", &cluster.conf).stdout(std::process::Stdio::null());
    let mut farm = farm.spawn().unwrap();

    // Two tasks run; one node dies, and what the first task delivers is not what it rendered
    wait_for("tasks on both nodes", || {
        let running = cluster.run(Command::new("squeue").args(["-h", "-t", "R", "-o", "%N"]));
        (running.contains("n1") && running.contains("n2")).then_some(())
    });
    cluster.script(&["kill", "n2"]);
    let first = wait_for("a shard", || shards(&path("frame/frame/shards")).pop());
    std::fs::write(&first, "rubbish").unwrap();
    assert!(farm.wait().unwrap().success());
    assert_same(&path("one"), &path("frame/frame"));
    assert!(first.with_extension("nfs.bad").exists(), "nobody noticed");

    cluster.run(Command::new("slurmd").args(["-N", "n2"]));
    sequence(&cluster, &path("sequence"));
}

/// Two frames that differ by their scenes; the second waits for the exposure of the first.
fn sequence(cluster: &Cluster, dir: &Path) {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    let box_ = std::fs::read_to_string(scene).unwrap();
    let folder = tempdir().unwrap();
    let xml = |frame: &str| folder.path().join(format!("box.{frame}.xml"));
    std::fs::write(xml("5"), &box_).unwrap();
    std::fs::write(xml("6"), box_.replacen("0.", "0.9", 1)).unwrap();
    plan(dir, &["--frames", "5-6"], &SCENE.replace("cornell-box", text(&xml("{frame}"))));
    let args = ["farm", "run", text(dir), "--wait", "--every", "0.2"];
    let said = cluster.run(&mut command(&args));
    assert!(said.contains("0005: done") && said.contains("0006: done"), "{said}");
    let exposure = json(&dir.join("0005/report.json"))["exposure"].to_string();
    for (frame, more) in [("5", String::new()), ("6", format!(" --exposure {exposure}"))] {
        let (one, farmed) = (dir.join(format!("one-{frame}")), dir.join(format!("000{frame}")));
        // Each frame has a seed of its own
        let seed = json(&farmed.join("report.json"))["seed"].to_string();
        let scene = SCENE.replace("cornell-box", text(&xml(frame))) + &more;
        render(&one, &scene.replace("--seed 5", &format!("--seed {seed}")));
        assert_same(&one, &farmed);
        assert_eq!(json(&farmed.join("report.json"))["exposure"].to_string(), exposure);
    }
}
