//! Writes the seeds of a target into a folder: `cargo run -p bunraku-fuzz --example seeds -- TARGET FOLDER`.
use bunraku_fuzz::TARGETS;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [name, folder] = arguments.as_slice() else {
        eprintln!("Usage: seeds TARGET FOLDER");
        return ExitCode::from(2);
    };
    let Some(target) = TARGETS.iter().find(|target| target.name == name) else {
        eprintln!(
            "seeds: found target {name}, expected one of {}",
            TARGETS.map(|target| target.name).join(", ")
        );
        return ExitCode::from(2);
    };
    let folder = Path::new(folder);
    let written = fs::create_dir_all(folder).and_then(|()| {
        let mut seeds = (target.seeds)().into_iter().enumerate();
        seeds.try_for_each(|(number, seed)| fs::write(folder.join(format!("seed-{number:02}")), seed))
    });
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("seeds: cannot write to {}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}
