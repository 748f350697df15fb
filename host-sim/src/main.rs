//! `bunraku`: encode, inspect, compare and play recorded motion.

/// `println!` with text out of files as a terminal may show it.
macro_rules! println {
    () => { std::println!() };
    ($($arguments:tt)*) => { std::println!("{}", host_sim::terminal::shown(&format!($($arguments)*))) };
}

/// `eprintln!` with text out of files as a terminal may show it, and words cut to what a message should have.
macro_rules! eprintln {
    ($($arguments:tt)*) => { std::eprintln!("{}", host_sim::terminal::message(&format!($($arguments)*))) };
}

mod commands;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::process::ExitCode;

/// Fits recorded human motion to a puppet, compresses it, and plays it on servos.
#[derive(Parser)]
#[command(name = "bunraku", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Encode(commands::encode::Args),
    Decode(commands::decode::Args),
    Info(commands::info::Args),
    Compare(commands::compare::Args),
    Optimize(commands::optimize::Args),
    Play(commands::play::Args),
    Follow(commands::follow::Args),
    Puppet(commands::puppet::Args),
    Profile(commands::profile::Args),
    Image(commands::image::Args),
    Emulate(commands::emulate::Args),
    Qemu(commands::qemu::Args),
    Demo(commands::demo::Args),
    Bench(commands::bench::Args),
    Table1(commands::table1::Args),
    Servos(commands::servos::Args),
    Show(commands::show::Args),
    Device(commands::device::Args),
    Push(commands::push::Args),
    Stream(commands::stream::Args),
    Monitor(commands::monitor::Args),
    Rd(commands::rd::Args),
    Train(commands::train::Args),
    Wearable(commands::wearable::Args),
}

fn main() -> ExitCode {
    // A reader that has seen enough, such as `head`, ends the command quietly.
    sigpipe::reset();
    let matches = numbers_may_be_negative(Cli::command()).get_matches();
    match run(Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("bunraku: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The command, to all of whose options a number below 0 may be given: then the option says which numbers it takes, and `-1`
/// is not taken for the name of another one.
fn numbers_may_be_negative(command: clap::Command) -> clap::Command {
    command
        .mut_args(|argument| {
            let takes_value = argument.get_action().takes_values();
            if takes_value { argument.allow_negative_numbers(true) } else { argument }
        })
        .mut_subcommands(numbers_may_be_negative)
}

fn run(cli: Cli) -> anyhow::Result<ExitCode> {
    match cli.command {
        Command::Encode(args) => commands::encode::run(args),
        Command::Decode(args) => commands::decode::run(args),
        Command::Info(args) => commands::info::run(args),
        Command::Compare(args) => commands::compare::run(args),
        Command::Optimize(args) => commands::optimize::run(args),
        Command::Play(args) => commands::play::run(args),
        Command::Follow(args) => commands::follow::run(args),
        Command::Puppet(args) => commands::puppet::run(args),
        Command::Profile(args) => commands::profile::run(args),
        Command::Emulate(args) => commands::emulate::run(args),
        Command::Image(args) => commands::image::run(args),
        Command::Qemu(args) => commands::qemu::run(args),
        Command::Demo(args) => commands::demo::run(args),
        Command::Bench(args) => commands::bench::run(args),
        Command::Table1(args) => commands::table1::run(args),
        Command::Show(args) => commands::show::run(args),
        Command::Servos(args) => commands::servos::run(args),
        Command::Device(args) => commands::device::run(args),
        Command::Push(args) => commands::push::run(args),
        Command::Stream(args) => commands::stream::run(args),
        Command::Monitor(args) => commands::monitor::run(args),
        Command::Rd(args) => commands::rd::run(args),
        Command::Train(args) => commands::train::run(args),
        Command::Wearable(args) => commands::wearable::run(args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a command's help lacks, and those of its subcommands. An example of a command holds for its subcommands too.
    fn lacks(command: &clap::Command, name: &str, has_example: bool, found: &mut Vec<String>) {
        let after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let has_example = has_example || after.contains("Example");
        if command.get_subcommands().next().is_none() && !has_example {
            found.push(format!("{name} has no example"));
        }
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        if about.is_empty() {
            found.push(format!("{name} does not say what it does"));
        }
        for argument in command.get_arguments() {
            if argument.get_help().is_none() {
                found.push(format!("{name} does not say what {} is", argument.get_id()));
            }
        }
        for child in command.get_subcommands() {
            lacks(child, &format!("{name} {}", child.get_name()), has_example, found);
        }
    }

    #[test]
    fn every_command_says_what_it_does_with_an_example() {
        let command = Cli::command();
        numbers_may_be_negative(command.clone()).debug_assert();
        let mut found = Vec::new();
        lacks(&command, "bunraku", false, &mut found);
        assert!(found.is_empty(), "{found:#?}");
    }

    /// Arguments that are numbers with a fraction, as command lines that give them `text`.
    fn number_arguments(command: &clap::Command, path: &[String], text: &str, found: &mut Vec<Vec<String>>) {
        let number = clap::builder::ValueParser::from(clap::value_parser!(f64)).type_id();
        for argument in
            command.get_arguments().filter(|argument| argument.get_value_parser().type_id() == number)
        {
            let mut line = path.to_vec();
            match (argument.get_long(), argument.get_index()) {
                (Some(long), _) => line.push(format!("--{long}={text}")),
                (None, index) => {
                    line.extend(std::iter::repeat_n("x".to_owned(), index.unwrap() - 1));
                    line.push(text.to_owned());
                }
            }
            found.push(line);
        }
        for child in command.get_subcommands() {
            let path = [path, &[child.get_name().to_owned()]].concat();
            number_arguments(child, &path, text, found);
        }
    }

    /// Whatever a number is for: what is none, or outside of its range, is refused where it is read, with the range.
    #[test]
    fn every_number_has_a_range() {
        let mut command = numbers_may_be_negative(Cli::command());
        command.build();
        for text in ["nan", "inf", "1e300", "-1e300", "12.5.", ""] {
            let mut lines = Vec::new();
            number_arguments(&command, &["bunraku".to_owned()], text, &mut lines);
            assert!(lines.len() > 20, "{lines:?}");
            for line in lines {
                let said = command.clone().try_get_matches_from(&line).unwrap_err().to_string();
                assert!(said.contains("expected ") && said.contains(" found "), "{line:?}: {said}");
            }
        }
        // A number below 0 is no option's name.
        for line in [&["encode", "a.bvh", "--target-degrees", "-1"][..], &["play", "--speed", "-0.5"]] {
            let line = [&["bunraku"], line].concat();
            let said = command.clone().try_get_matches_from(&line).unwrap_err().to_string();
            assert!(said.contains("expected a") && !said.contains("tip"), "{said}");
        }
    }

    #[test]
    fn the_version_names_the_command() {
        assert_eq!(Cli::command().render_version(), format!("bunraku {}\n", env!("CARGO_PKG_VERSION")));
    }
}
