//! Codecs and entropy stages on a command line. Names, explanations and settings come from the lists of both.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, FromArgMatches};
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::codec::encode::{CodecOption, OptionError};
use encoder::codec::{self, CodecSettings};

/// Parses the name of a codec.
pub fn codec() -> impl TypedValueParser<Value = CodecId> {
    let value =
        |id: CodecId| PossibleValue::new(id.name()).help(codec::about(id).trim().trim_end_matches('.'));
    let find = |name: String| CodecId::ALL.into_iter().find(|id| id.name() == name).ok_or("no codec");
    PossibleValuesParser::new(CodecId::ALL.map(value)).try_map(find)
}

/// Parses the name of an entropy stage; `fixed` is short for `fixed-width`.
pub fn entropy() -> impl TypedValueParser<Value = EntropyId> {
    let value = |id: EntropyId| match id {
        EntropyId::FixedWidth => PossibleValue::new("fixed").alias(id.name()).help("Codes of fixed width"),
        EntropyId::Huffman => PossibleValue::new(id.name()).help("Static Huffman codes"),
        EntropyId::AdaptiveHuffman => PossibleValue::new(id.name()).help("Adaptive Huffman codes"),
    };
    let values = EntropyId::ALL.map(value);
    let parse = PossibleValuesParser::new(values.clone());
    let find = move |name: String| {
        let index = values.iter().position(|value| value.matches(&name, false));
        index.and_then(|index| EntropyId::ALL.get(index).copied()).ok_or("no entropy stage")
    };
    parse.try_map(find)
}

/// The options that codecs have of their own, as they were given.
#[derive(Clone, Debug, Default)]
pub struct Options {
    given: Vec<(&'static str, String)>,
}

impl Options {
    /// The settings of a codec with these options.
    ///
    /// # Errors
    /// [`OptionError`] where one is no option of the codec, cannot have its value, or does not go with another.
    pub fn settings(&self, codec: CodecId) -> Result<CodecSettings, OptionError> {
        let mut settings = CodecSettings::new(codec);
        let encoder = settings.encoder_mut();
        self.given.iter().try_for_each(|(option, value)| encoder.set(option, value))?;
        encoder.check()?;
        Ok(settings)
    }

    /// Names of the options that were given.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        self.given.iter().map(|(name, _)| *name)
    }

    /// All options that there are, each with the names of the codecs that have it.
    fn all() -> Vec<(CodecOption, Vec<&'static str>)> {
        let mut all: Vec<(CodecOption, Vec<&'static str>)> = Vec::new();
        for id in CodecId::ALL {
            for &option in CodecSettings::new(id).encoder().options() {
                match all.iter_mut().find(|(other, _)| other.name == option.name) {
                    Some((_, codecs)) => codecs.push(id.name()),
                    None => all.push((option, vec![id.name()])),
                }
            }
        }
        all
    }
}

impl clap::Args for Options {
    fn augment_args(command: Command) -> Command {
        let arg = |(option, codecs): (CodecOption, Vec<&str>)| {
            let arg = Arg::new(option.name)
                .long(option.name)
                .value_name(option.value_name)
                .default_value(option.default)
                .help(format!("{} (--codec {})", option.help, codecs.join(", ")));
            if option.values.is_empty() {
                return arg;
            }
            let values = option.values.iter().map(|&(name, help)| PossibleValue::new(name).help(help));
            arg.value_parser(PossibleValuesParser::new(values))
        };
        command.args(Self::all().into_iter().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Options {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let names = Self::all().into_iter().map(|(option, _)| option.name);
        let given = names.filter(|name| matches.value_source(name) == Some(ValueSource::CommandLine));
        let pair = |name| Some((name, matches.get_one::<String>(name)?.clone()));
        Ok(Self { given: given.filter_map(pair).collect() })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Args;

    fn parse(words: &[&str]) -> Result<Options, clap::Error> {
        let command = Options::augment_args(Command::new("encode").no_binary_name(true));
        Options::from_arg_matches(&command.try_get_matches_from(words)?)
    }

    #[test]
    fn names_are_those_of_the_lists() {
        let command = Command::new("encode").no_binary_name(true);
        let command = command.arg(Arg::new("codec").value_parser(codec()));
        let command = command.arg(Arg::new("entropy").value_parser(entropy()));
        for (id, stage) in CodecId::ALL.into_iter().zip(EntropyId::ALL.into_iter().cycle()) {
            let words = [id.name(), stage.name()];
            let matches = command.clone().try_get_matches_from(words).unwrap();
            assert_eq!(matches.get_one("codec"), Some(&id));
            assert_eq!(matches.get_one("entropy"), Some(&stage));
        }
        assert!(command.clone().try_get_matches_from(["pcm", "fixed"]).is_ok());
        assert!(command.try_get_matches_from(["mp3"]).is_err());
    }

    #[test]
    fn every_option_has_its_default_and_belongs_to_a_codec() {
        for (option, codecs) in Options::all() {
            let given = parse(&[&format!("--{}", option.name), option.default]).unwrap();
            for id in CodecId::ALL {
                let settings = given.settings(id);
                if codecs.contains(&id.name()) {
                    assert_eq!(settings.unwrap(), CodecSettings::new(id), "--{}", option.name);
                } else {
                    let expected = format!("codec {} has no --{}", id.name(), option.name);
                    assert_eq!(settings.unwrap_err().to_string(), expected);
                }
            }
        }
        assert_eq!(parse(&[]).unwrap().settings(CodecId::Adpcm), Ok(CodecSettings::new(CodecId::Adpcm)));
    }
}
