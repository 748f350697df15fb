//! Every command line of the README and the docs, run as it stands there.
//!
//! A command line is a line of a code block that begins with `bunraku`, `cargo bunraku`, `cargo xtask` or `.ci/run`. Those of a
//! page are run in their order in one folder. All are asked for `--help` behind their options, so that an option that does
//! not exist is found also where a line cannot be run to its end.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::{bunraku, motion, workspace};
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Lines that are not run to their end: a part of the line, and why. Their options are checked all the same.
const NOT_RUN: [(&str, &str); 9] = [
    (" bench peers ", "takes minutes; tests/bench_peers.rs runs it"),
    (" table1 ", "takes a minute; tests/table1.rs runs it"),
    (" image ", "links for minutes; tests/boards.rs runs it"),
    (" --on qemu", "builds a board's image, for a minute; tests/play.rs runs it"),
    (" --on sim", "builds a board's image, for a minute; tests/play.rs and tests/show.rs run it"),
    (" --on rp2040", "builds a board's image, for minutes; tests/play.rs runs it"),
    (" emulate ", "builds a board's image, for minutes; tests/emulate.rs runs it"),
    (" --max-cycles ", "builds images; tests/mclip_cycles.rs runs it"),
    (" puppet calibrate", "waits for somebody who turns the joints; tests/puppet.rs does"),
];

/// Commands that run until they are stopped. They are started, and stopped at the end of the page.
const ENDLESS: [&str; 4] = [" servos ", " device ", " follow ", " monitor "];

/// What stands for something else on every page: the page's word, and the test's.
const STAND_INS: [(&str, &str); 4] = [
    // Twenty trials take minutes.
    ("cmu/*.amc", "02_01.amc"),
    ("*.amc", "02_01.amc"),
    ("FOLDER", "cmu"),
    // A port of a fixed number may be taken.
    ("--listen tcp:127.0.0.1:4100", "--listen tcp:127.0.0.1:0"),
];

/// Ports on pages: of a device with a board's firmware, for which a virtual one stands, and of servos.
const DEVICE_PORTS: [&str; 3] = ["tcp:127.0.0.1:4100", "/dev/ttyACM0", "/dev/ttyUSB0"];
const SERVO_PORTS: [&str; 2] = ["ax=/dev/pts/0,...", "/dev/pts/N"];

/// Longest that a command may take, also on a machine that is busy: one that hangs is ended.
const LIMIT: Duration = Duration::from_secs(1200);

/// The command lines of a page, comments behind them left out.
fn command_lines(page: &str) -> Vec<String> {
    let (mut lines, mut fenced, mut unfinished) = (vec![], false, String::new());
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        if !fenced && !line.starts_with("    ") {
            continue;
        }
        let line = line.trim().trim_start_matches("$ ");
        let begins = ["bunraku ", "cargo bunraku ", "cargo xtask ", ".ci/run"]
            .iter()
            .any(|name| line.starts_with(name));
        if unfinished.is_empty() && !begins {
            continue;
        }
        match line.strip_suffix('\\') {
            Some(line) => unfinished += line,
            None => {
                let line = std::mem::take(&mut unfinished) + line;
                // Behind two spaces, it is told what the line does.
                lines.push(line.split("  ").next().unwrap_or_default().trim().to_owned());
            }
        }
    }
    lines
}

/// A page whose commands are run.
struct Page {
    folder: TempDir,
    running: Vec<Child>,
    servos: Option<String>,
    device: Option<String>,
}

impl Drop for Page {
    fn drop(&mut self) {
        for process in &mut self.running {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// A copy that may be written over, whatever its source may.
fn copy(from: &Path, to: &Path) {
    fs::write(to, fs::read(from).unwrap()).unwrap();
}

impl Page {
    /// A folder with recorded motion, the puppets, and clips as other pages make them.
    fn new(motion: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let to = |name: &str| folder.path().join(name);
        symlink(workspace().join("puppets"), to("puppets")).unwrap();
        symlink(motion.join("cmu"), to("cmu")).unwrap();
        for entry in fs::read_dir(motion.join("cmu")).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &folder.path().join(entry.file_name()));
        }
        // A copy: a page writes a file of this name, and links are followed.
        copy(&motion.join("bvh/cmu_02_02_cgspeed.bvh"), &to("walk.bvh"));
        let mut page = Self { folder, running: vec![], servos: None, device: None };
        for line in [
            "bunraku encode 02_01.amc --skeleton 02.asf --codec qmd -o walk.qmd",
            "bunraku encode 02_01.amc --skeleton 02.asf --codec dpcm --bits 7 -o walk.mclip",
            "bunraku encode 05_03.amc --skeleton 05.asf --codec dpcm --bits 7 -o dance.mclip",
            "bunraku demo --output demo",
        ] {
            page.run(line).unwrap();
        }
        page
    }

    /// The command of a line, or `None` where it is one of the workspace's that no test can run.
    fn command(&self, line: &str) -> Result<Option<Command>, String> {
        let mut words = line.split_whitespace();
        match (words.next(), words.clone().next()) {
            (Some("cargo"), Some("bunraku")) => drop(words.next()),
            (Some("cargo"), Some("xtask")) => return of_xtask(line).map(|()| None),
            (Some(".ci/run"), _) => return of_ci(line).map(|()| None),
            _ => {}
        }
        let mut command = bunraku();
        command.args(words).current_dir(self.folder.path()).stdin(Stdio::null());
        Ok(Some(command))
    }

    /// The line with this machine's names in it.
    fn stand_in(&mut self, line: &str) -> Result<String, String> {
        let mut line = format!("{line} ");
        for (from, to) in STAND_INS {
            line = line.replace(&format!("{from} "), &format!("{to} "));
        }
        for port in SERVO_PORTS {
            if line.contains(port) {
                let servos =
                    self.servos.clone().ok_or(format!("no line before starts the servos at {port}"))?;
                line = line.replace(port, &servos);
            }
        }
        for port in DEVICE_PORTS {
            if line.contains(port) {
                if self.device.is_none() {
                    let device = "bunraku device --puppet puppets/cmu-12.toml --skeleton 02.asf --listen tcp:127.0.0.1:0";
                    self.run(device)?;
                }
                line = line.replace(port, self.device.as_deref().unwrap_or_default());
            }
        }
        Ok(line.trim().to_owned())
    }

    /// Runs a line as far as it can be.
    fn run(&mut self, line: &str) -> Result<(), String> {
        let wrong = |why: &str| format!("{line}\n  {why}");
        let Some(mut help) = self.command(line).map_err(|why| wrong(&why))? else { return Ok(()) };
        let output = help.arg("--help").output().unwrap();
        if !output.status.success() {
            return Err(wrong(&String::from_utf8_lossy(&output.stderr)));
        }
        let spaced = format!(" {line} ");
        if let Some((_, why)) = NOT_RUN.iter().find(|(part, _)| spaced.contains(part)) {
            println!("not run, {why}: {line}");
            return Ok(());
        }
        let real = self.stand_in(line).map_err(|why| wrong(&why))?;
        let Some(mut command) = self.command(&real)? else { return Ok(()) };
        if ENDLESS.iter().any(|name| spaced.contains(name)) {
            return self.start(&real, command).map_err(|why| wrong(&why));
        }
        let began = Instant::now();
        let errors = self.folder.path().join("errors.txt");
        command.stdout(Stdio::null()).stderr(fs::File::create(&errors).unwrap());
        let mut process = command.spawn().unwrap();
        let status = loop {
            if let Some(status) = process.try_wait().unwrap() {
                break status;
            }
            if began.elapsed() > LIMIT {
                let _ = process.kill();
                return Err(wrong(&format!("is not at its end after {LIMIT:?}")));
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        println!("{:6.2} s: {line}", began.elapsed().as_secs_f64());
        let said = fs::read_to_string(&errors).unwrap();
        // A machine that is busy may be too slow for servos that are driven in real time, and says so.
        let late = ["ticks come too late", "did not answer in time"].iter().any(|why| said.contains(why));
        if status.success() || late && real.contains("/dev/pts/") {
            Ok(())
        } else {
            Err(wrong(&format!("{status}: {said}")))
        }
    }

    /// Starts what runs until it is stopped, and notes the port that it prints.
    fn start(&mut self, line: &str, mut command: Command) -> Result<(), String> {
        let errors = self.folder.path().join(format!("errors-{}.txt", self.running.len()));
        command.stdout(Stdio::piped()).stderr(fs::File::create(&errors).unwrap());
        let mut process = command.spawn().unwrap();
        let mut first = String::new();
        let mut out = BufReader::new(process.stdout.take().unwrap());
        let read = out.read_line(&mut first).unwrap();
        self.running.push(process);
        if read == 0 {
            return Err(format!("ended without a word: {}", fs::read_to_string(&errors).unwrap()));
        }
        let first = first.trim().to_owned();
        println!("started, prints {first}: {line}");
        if line.contains(" servos ") {
            self.servos = Some(first);
        } else if line.contains(" device ") {
            self.device = Some(first);
        }
        Ok(())
    }
}

/// `cargo xtask COMMAND` is in its usage. It is not run: most of its commands build or test all that there is.
fn of_xtask(line: &str) -> Result<(), String> {
    let usage = fs::read_to_string(workspace().join("xtask/src/main.rs")).unwrap();
    let name = line.split_whitespace().nth(2).unwrap_or_default();
    let known =
        usage.lines().any(|line| line.starts_with("  ") && line.split_whitespace().next() == Some(name));
    if known { Ok(()) } else { Err(format!("cargo xtask has no command {name:?}")) }
}

/// `.ci/run PART` is one of its parts. It is not run, since it runs this test.
fn of_ci(line: &str) -> Result<(), String> {
    let script = fs::read_to_string(workspace().join(".ci/run")).unwrap();
    match line.split_whitespace().nth(1) {
        Some(part) if !script.contains(&format!("#   .ci/run {part} ")) => {
            Err(format!(".ci/run has no part {part:?}"))
        }
        _ => Ok(()),
    }
}

/// All pages in a folder and those below it, sorted.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            found.extend(pages(&path));
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Runs the lines of all pages that are wanted; fails with all that went wrong.
fn run_pages(wanted: impl Fn(&Path) -> bool) {
    let Some(motion) = motion() else { return };
    let (mut count, mut wrong) = (0, vec![]);
    for path in pages(workspace()) {
        let name = path.strip_prefix(workspace()).unwrap().to_path_buf();
        let lines = command_lines(&fs::read_to_string(&path).unwrap());
        if lines.is_empty() || !wanted(&name) {
            continue;
        }
        let mut page = Page::new(&motion);
        for line in lines {
            count += 1;
            wrong.extend(page.run(&line).err().map(|why| format!("{}: {why}", name.display())));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 2, "{count} command lines");
}

#[test]
fn the_commands_of_the_readme_run() {
    run_pages(|page| page == Path::new("README.md"));
}

#[test]
fn the_commands_of_the_docs_run() {
    run_pages(|page| page.starts_with("docs"));
}

#[test]
fn the_commands_of_all_other_pages_run() {
    run_pages(|page| page != Path::new("README.md") && !page.starts_with("docs"));
}

#[test]
fn what_does_not_exist_is_found() {
    let Some(motion) = motion() else { return };
    let mut page = Page::new(&motion);
    for (line, expected) in [
        ("bunraku encode 02_01.amc --skeleton 02.asf --codecs qmd -o walk.qmd", "--codecs"),
        ("cargo bunraku image walk.qmd --bord rp2040", "--bord"),
        ("bunraku encode 02_01.amc --skeleton 03.asf -o walk.qmd", "03.asf"),
        ("bunraku dance walk.qmd", "dance"),
        ("cargo xtask dance", "dance"),
        (".ci/run dance", "dance"),
        (
            "bunraku puppet scan --puppet puppets/cmu-12.toml --on /dev/pts/N",
            "no line before starts the servos",
        ),
    ] {
        let error = page.run(line).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn lines_of_blocks_are_read_without_their_comments() {
    let page = "Run `bunraku info`, or\n\n    bunraku info walk.qmd   # sizes\n    then: bunraku no\n\n```sh\n$ cargo bunraku rd \\\n  \
        --fps 30\n```\nbunraku is no command here\n";
    assert_eq!(command_lines(page), ["bunraku info walk.qmd", "cargo bunraku rd --fps 30"]);
}
