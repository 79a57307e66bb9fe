//! Whose eyes.

use super::oracle::{OracleArgs, load_model};
use super::viewing::ViewingArgs;
use crate::refuse;
use crate::say::note;
use clap::Args;
use noisefloor::{Audience, Model, Oracle, Viewing};
use noisefloor_eyes::{Eyes, Person};
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Whose eyes, as `noisefloor calibrate` has measured them.
#[derive(Debug, Args)]
pub struct EyesArgs {
    /// Whose eyes: a file of `noisefloor calibrate`, of whose people nine of ten will be content, or `none`
    /// for the observers of the training data [default: yours if you have calibrated them; none with --model
    /// or other options that say who looks, and where].
    #[arg(long, value_name = "FILE|none")]
    eyes: Option<EyesChoice>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum EyesChoice {
    Nobody,
    File(PathBuf),
}

impl FromStr for EyesChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(if text == "none" { Self::Nobody } else { Self::File(text.into()) })
    }
}

/// An oracle, where it looks, and for whom.
pub struct Seen {
    pub oracle: Oracle,
    pub viewing: Viewing,
    pub audience: Audience,
}

impl EyesArgs {
    /// By the eyes that count, or by what was typed.
    pub fn look(
        &self,
        oracle: &OracleArgs,
        viewing: &ViewingArgs,
        audience: Option<Audience>,
    ) -> anyhow::Result<Seen> {
        let said = [("--viewing", viewing.typed().is_some()), ("--audience", audience.is_some())];
        let person = self.of(oracle.model.as_deref(), &said)?;
        let oracle = oracle.check()?;
        Ok(match person {
            Some(person) => Seen {
                oracle: oracle.with_scatter(person.uncertainty()),
                viewing: person.viewing(),
                audience: person.audience(),
            },
            None => Seen {
                viewing: viewing.judged_by(&oracle)?,
                audience: audience.unwrap_or(Audience::TRAINED),
                oracle,
            },
        })
    }

    /// Beside what looks with other eyes, a file has no effect: it is read even so, and that is said.
    pub fn unused(&self, beside: &str) -> anyhow::Result<()> {
        if let Some(EyesChoice::File(path)) = &self.eyes {
            Eyes::read(path)?;
            note!("warning: --eyes has no effect with {beside}");
        }
        Ok(())
    }

    /// Whose eyes count, and says so in a line. `said` are other options that say who looks, or where: with
    /// them, eyes must be asked for, and contradict them.
    pub fn of(&self, model: Option<&Path>, said: &[(&str, bool)]) -> anyhow::Result<Option<Person>> {
        let otherwise = said.iter().find(|(_, given)| *given);
        let (eyes, asked) = match (&self.eyes, otherwise) {
            (Some(EyesChoice::Nobody), _) => return Ok(None),
            (Some(EyesChoice::File(_)), Some((option, _))) => {
                refuse!("--eyes and {option} both say who looks, and where; leave one out")
            }
            (Some(EyesChoice::File(path)), None) => (Eyes::read(path)?, true),
            (None, Some(_)) => return Ok(None),
            (None, None) if model.is_some() => return Ok(None),
            (None, None) => match Eyes::own() {
                Ok(Some(own)) => (own, false),
                Ok(None) => return Ok(None),
                Err(error) => {
                    refuse!("{error}; `noisefloor calibrate` writes it anew, --eyes none goes without")
                }
            },
        };
        let digest = match model {
            None => Model::bundled().digest(),
            Some(_) => load_model(model)?.digest(),
        };
        let others: Vec<&str> =
            eyes.people().iter().filter(|p| p.model != digest).map(|p| p.name.as_str()).collect();
        let what = format!("the eyes of {} were measured beside another model", others.join(", "));
        let Some(eyes) = eyes.beside(&digest) else {
            if asked {
                refuse!("--eyes: {what}; calibrate again");
            }
            note!("note: {what}, and are not used; `noisefloor calibrate` takes two minutes");
            return Ok(None);
        };
        if !others.is_empty() {
            note!("warning: {what}, and are left out; calibrate them again");
        }
        let person = eyes.strictest();
        note!(
            "note: for the eyes of {} ({:.2} times the samples of the model's observers, {:.0} pixels per degree, \
             measured on {}); --eyes none for those of the observers",
            person.name,
            person.factor,
            person.display.pixels_per_degree,
            person.date
        );
        Ok(Some(person.clone()))
    }
}
