//! What `noisefloor calibrate` has measured of people's eyes and displays, as a file.
//!
//! ```
//! use noisefloor_eyes::Eyes;
//!
//! let eyes = Eyes::parse(r#"
//!     version = 1
//!     [[person]]
//!     name = "me"
//!     factor = 1.4
//!     interval = [1.2, 1.65]
//!     scatter = 0.3
//!     answers = 38
//!     date = "2026-11-24"
//!     model = "of the model, a digest"
//!     [person.display]
//!     pixels-per-degree = 44.0
//!     distance-mm = 600.0
//!     gamma = 2.2
//!     ambient = "dim"
//! "#)?;
//! let person = eyes.strictest();
//! let params = noisefloor::Params::default()
//!     .with_audience(person.audience())
//!     .with_viewing(person.viewing());
//! assert_eq!(params.audience.slope, 1.4);
//! # Ok::<(), noisefloor_eyes::EyesError>(())
//! ```

use noisefloor::{Audience, Viewing, viewing::ViewingParams};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Version of the file's format.
const VERSION: u32 = 1;
/// Longest file, in bytes.
const MAX_FILE: u64 = 1 << 20;
/// Longest text in it, in bytes.
const MAX_TEXT: usize = 200;
/// Of a studio's people, so many are content with whoever [`Eyes::strictest`] names.
const CONTENT: f64 = 0.9;

/// The people of a file, at least one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Contents", into = "Contents")]
pub struct Eyes(Vec<Person>);

/// One person, at one display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Person {
    /// Who.
    pub name: String,
    /// How many times the samples of the model's observers they need, within 0.02…50.
    pub factor: f64,
    /// 80 % interval of the factor.
    pub interval: [f64; 2],
    /// Scale of the logistic scatter of their answers, in ln(samples).
    pub scatter: f64,
    /// Answers that this rests on.
    pub answers: u32,
    /// Day of the measurement, as 2026-11-24.
    pub date: String,
    /// Digest of the model whose observers they were compared with.
    pub model: String,
    /// Where they looked.
    pub display: SeenDisplay,
}

/// A display and how it was seen, as reported by whoever looked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SeenDisplay {
    /// Device pixels per degree of visual angle, within 1…2000.
    pub pixels_per_degree: f64,
    /// Distance of the eyes, in millimetres.
    pub distance_mm: f64,
    /// Exponent of the display, by a test chart: recorded, and not used, since the factor counts it.
    pub gamma: f64,
    /// Light in the room: `dark`, `dim` or `bright`. Recorded, as gamma is.
    pub ambient: String,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Contents {
    version: u32,
    person: Vec<Person>,
}

/// Why there are no eyes.
#[derive(Debug, thiserror::Error)]
pub enum EyesError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Its contents are not what `noisefloor calibrate` writes.
    #[error("no eyes as `noisefloor calibrate` writes them: {0}")]
    Text(String),
    /// The system has no place for settings.
    #[error("there is no folder for settings: {0}; set HOME or XDG_CONFIG_HOME")]
    NoPlace(String),
}

impl TryFrom<Contents> for Eyes {
    type Error = String;

    fn try_from(contents: Contents) -> Result<Self, String> {
        let Contents { version, person: people } = contents;
        if version != VERSION {
            return Err(format!("version {version}, and this program reads {VERSION}; calibrate again"));
        }
        if people.is_empty() {
            return Err("nobody is in it".to_owned());
        }
        people.iter().try_for_each(Person::check)?;
        Ok(Self(people))
    }
}

impl From<Eyes> for Contents {
    fn from(eyes: Eyes) -> Self {
        Self { version: VERSION, person: eyes.0 }
    }
}

impl Person {
    fn check(&self) -> Result<(), String> {
        let within = |what: &str, value: f64, [low, high]: [f64; 2]| {
            let fits = (low..=high).contains(&value);
            if fits { Ok(()) } else { Err(format!("{what} is {value}, not {low} to {high}")) }
        };
        within("factor", self.factor, [0.02, 50.0])?;
        within("interval", self.interval[0], [0.0, self.factor])?;
        within("interval", self.interval[1], [self.factor, 1e6])?;
        within("scatter", self.scatter, [0.0, 10.0])?;
        within("pixels-per-degree", self.display.pixels_per_degree, [1.0, 2000.0])?;
        within("distance-mm", self.display.distance_mm, [1.0, 1e6])?;
        within("gamma", self.display.gamma, [1.0, 4.0])?;
        let texts = [&self.name, &self.date, &self.model, &self.display.ambient];
        match texts
            .iter()
            .find(|text| text.is_empty() || text.len() > MAX_TEXT || text.contains(char::is_control))
        {
            Some(text) => Err(format!("{text:?} is empty, too long or not printable")),
            None => Ok(()),
        }
    }

    /// For sessions: whose thresholds are [`Person::factor`] times those of the model's observers.
    pub fn audience(&self) -> Audience {
        Audience { slope: self.factor, offset: 0.0 }
    }

    /// For [`noisefloor::Oracle::with_scatter`]: the standard deviation of ln(samples) that the measurement leaves.
    pub fn uncertainty(&self) -> f64 {
        // The middle 80 % of a normal distribution are 2.563 deviations wide; an interval may reach down to 0
        let [low, high] = self.interval.map(|factor| factor.max(1e-3).ln());
        ((high - low) / 2.563).clamp(0.01, 5.0)
    }

    /// For sessions: the default display, at the person's pixels per degree.
    pub fn viewing(&self) -> Viewing {
        let params = Viewing::default().params();
        let seen = ViewingParams { pixels_per_degree: self.display.pixels_per_degree, ..params };
        seen.check().unwrap_or_default()
    }
}

impl Eyes {
    /// Where a person's own file is: `noisefloor/eyes.toml` in the system's folder for settings.
    ///
    /// # Errors
    /// [`EyesError::NoPlace`] if there is no such folder, as without a home.
    pub fn place() -> Result<PathBuf, EyesError> {
        use etcetera::BaseStrategy;
        let strategy = etcetera::choose_base_strategy().map_err(|e| EyesError::NoPlace(e.to_string()))?;
        Ok(strategy.config_dir().join("noisefloor").join("eyes.toml"))
    }

    /// The file at [`Eyes::place`]; `None` if nobody was calibrated.
    ///
    /// # Errors
    /// [`EyesError`] if there is one, and it cannot be read.
    pub fn own() -> Result<Option<Self>, EyesError> {
        let Ok(place) = Self::place() else { return Ok(None) };
        match Self::read(&place) {
            Err(EyesError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
            read => read.map(Some),
        }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`EyesError`] if it cannot be read, is longer than a megabyte, or holds something else.
    pub fn read(path: &Path) -> Result<Self, EyesError> {
        let io = |source| EyesError::Io { path: path.to_owned(), source };
        let mut text = String::new();
        File::open(path).map_err(io)?.take(MAX_FILE).read_to_string(&mut text).map_err(io)?;
        Self::parse(&text).map_err(|error| match error {
            EyesError::Text(what) => EyesError::Text(format!("{}: {what}", path.display())),
            other => other,
        })
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// [`EyesError::Text`] with what is wrong.
    pub fn parse(text: &str) -> Result<Self, EyesError> {
        toml::from_str(text).map_err(|error| EyesError::Text(one_line(&error)))
    }

    /// A file of one person.
    ///
    /// # Errors
    /// [`EyesError::Text`] if a number or a text of it is out of range.
    pub fn of(person: Person) -> Result<Self, EyesError> {
        person.check().map_err(EyesError::Text)?;
        Ok(Self(vec![person]))
    }

    /// The text of the file, as [`Eyes::parse`] reads it.
    ///
    /// # Errors
    /// [`EyesError::Text`] if TOML cannot say it.
    pub fn to_text(&self) -> Result<String, EyesError> {
        toml::to_string(self).map_err(|error| EyesError::Text(error.to_string()))
    }

    /// Puts a person into a file, which is made if it is not there, in place of whoever has the same name.
    /// The file changes as a whole or not at all.
    ///
    /// # Errors
    /// [`EyesError`] if the file holds something else, which stays, or cannot be written.
    pub fn keep(path: &Path, person: Person) -> Result<(), EyesError> {
        person.check().map_err(EyesError::Text)?;
        let mut people = match Self::read(path) {
            Ok(eyes) => eyes.0,
            Err(EyesError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(error),
        };
        people.retain(|other| other.name != person.name);
        people.push(person);
        let text = Self(people).to_text()?;
        let write = || -> io::Result<()> {
            let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
            std::fs::create_dir_all(folder)?;
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            file.write_all(text.as_bytes())?;
            file.as_file().sync_all()?;
            file.persist(path)?;
            Ok(())
        };
        write().map_err(|source| EyesError::Io { path: path.to_owned(), source })
    }

    /// Everybody.
    pub fn people(&self) -> &[Person] {
        &self.0
    }

    /// Whoever needs so many samples that nine of ten are content: of fewer than ten, the one who needs most.
    pub fn strictest(&self) -> &Person {
        let mut people: Vec<&Person> = self.0.iter().collect();
        people.sort_by(|a, b| a.factor.total_cmp(&b.factor));
        let at = (CONTENT * people.len() as f64).ceil() as usize;
        people[at.clamp(1, people.len()) - 1]
    }
}

/// What a parser says, without its picture of the place.
fn one_line(error: &toml::de::Error) -> String {
    error.message().lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(name: &str, factor: f64) -> Person {
        Person {
            name: name.to_owned(),
            factor,
            interval: [0.8 * factor, 1.25 * factor],
            scatter: 0.3,
            answers: 40,
            date: "2026-11-24".to_owned(),
            model: "abc".to_owned(),
            display: SeenDisplay {
                pixels_per_degree: 52.0,
                distance_mm: 650.0,
                gamma: 2.2,
                ambient: "dim".to_owned(),
            },
        }
    }

    #[test]
    fn people_are_kept_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/eyes.toml");
        for (name, factor) in [("me", 2.0), ("Zoë", 0.7), ("me", 1.25)] {
            Eyes::keep(&path, person(name, factor)).unwrap();
        }
        let eyes = Eyes::read(&path).unwrap();
        assert_eq!(eyes.people(), [person("Zoë", 0.7), person("me", 1.25)]);
        assert_eq!(eyes.strictest().name, "me");
        assert_eq!(eyes.strictest().viewing().params().pixels_per_degree, 52.0);
        assert!(Eyes::keep(&path, person("", 1.0)).is_err() && Eyes::keep(&path, person("x", 1e9)).is_err());
        assert_eq!(Eyes::read(&path).unwrap(), eyes);
        let text = Eyes::of(person("me", 1.25)).unwrap().to_text().unwrap();
        assert_eq!(Eyes::parse(&text).unwrap().people(), [person("me", 1.25)]);
        // A file of something else stays
        std::fs::write(&path, "colour = 1").unwrap();
        assert!(Eyes::keep(&path, person("me", 1.0)).is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "colour = 1");
    }

    #[test]
    fn nine_of_ten_are_content() {
        let of = |count: u32| {
            let people = (1..=count).map(|i| person(&format!("p{i}"), 0.1 * f64::from(i))).collect();
            (Eyes(people).strictest().factor * 10.0).round() as u32
        };
        assert_eq!([1, 2, 9, 10, 11, 20].map(of), [1, 2, 9, 9, 10, 18]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let good = toml::to_string(&Eyes(vec![person("me", 1.5)])).unwrap();
        assert!(Eyes::parse(&good).is_ok());
        let cases = [
            ("version = 1", "version = 2", "calibrate again"),
            ("factor = 1.5", "factor = nan", "factor"),
            ("factor = 1.5", "factor = 9.0", "interval"),
            ("factor = 1.5", "vector = 1.5", "vector"),
            ("name = \"me\"", "name = \"\"", "empty"),
        ];
        for (from, to, said) in cases {
            let error = Eyes::parse(&good.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(said), "{to}: {error}");
        }
        assert!(Eyes::parse("version = 1\nperson = []").unwrap_err().to_string().contains("nobody"));
    }
}
