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

use noisefloor::evidence::{Evidence, Samples};
use noisefloor::stills::{SnapshotPair, Still};
use noisefloor::{Audience, Oracle, TileGrid, ToneMapping, Viewing};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

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

/// What every version of the file begins with.
#[derive(Deserialize)]
struct Version {
    version: u32,
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
    /// It is no file that could be read as a whole.
    #[error("{}: {what}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What it is.
        what: &'static str,
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
        Self::check_texts([&self.name, &self.date, &self.model, &self.display.ambient].map(String::as_str))
    }

    fn check_texts<const N: usize>(texts: [&str; N]) -> Result<(), String> {
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

    /// Samples per pixel that this person needs of a tile of even noise on grey, by the bundled model: people
    /// compare by it, each at their own display.
    fn need(&self, oracle: &Oracle, [one, other]: &[Still; 2]) -> Option<u64> {
        let grid = TileGrid::new(one.size.0, one.size.1, one.size.0).ok()?;
        let (tone, samples) = (ToneMapping::default(), Some(Samples::Independent));
        let pair = SnapshotPair::new(Evidence::Halves, one, &[other], tone, samples).ok()?;
        let described = pair.seen_on(self.viewing()).describe(oracle, grid).ok()?;
        let verdicts = oracle.judge_described_for(&described, self.audience())?;
        verdicts.first()?.threshold.map(|threshold| threshold.median)
    }

    /// For sessions: the default display, at the person's pixels per degree.
    pub fn viewing(&self) -> Viewing {
        let mut seen = Viewing::default().params();
        seen.pixels_per_degree = self.display.pixels_per_degree;
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
    /// [`EyesError`] if it cannot be read, is no regular file or longer than a megabyte, or holds something
    /// else.
    pub fn read(path: &Path) -> Result<Self, EyesError> {
        let io = |source| EyesError::Io { path: path.to_owned(), source };
        let refused = |what| EyesError::File { path: path.to_owned(), what };
        // A pipe might never end
        let about = std::fs::metadata(path).map_err(io)?;
        if !about.is_file() {
            return Err(refused(
                "is a folder, a pipe or a device; name the file that `noisefloor calibrate` wrote",
            ));
        }
        let mut text = String::new();
        File::open(path).map_err(io)?.take(MAX_FILE + 1).read_to_string(&mut text).map_err(io)?;
        if text.len() as u64 > MAX_FILE {
            return Err(refused("is longer than a megabyte; divide its people among several files"));
        }
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
        // A newer file may have other fields: its version says more than they do
        if let Ok(Version { version }) = toml::from_str(text)
            && version > VERSION
        {
            return Err(EyesError::Text(format!(
                "version {version} of a newer noisefloor, and this one reads {VERSION}: use that one, \
                 or calibrate again"
            )));
        }
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
    /// The file changes as a whole or not at all; its permissions stay, and a link stays one. Several
    /// processes may do so at once.
    ///
    /// # Errors
    /// [`EyesError`] if the file holds something else, which stays, or cannot be written.
    pub fn keep(path: &Path, person: Person) -> Result<(), EyesError> {
        person.check().map_err(EyesError::Text)?;
        Self::change(path, Some(person))
    }

    /// Whether somebody of this name could be kept in a file: before questions are asked. Nothing is changed.
    ///
    /// # Errors
    /// Those of [`Eyes::keep`].
    pub fn check_keep(path: &Path, name: &str) -> Result<(), EyesError> {
        Person::check_texts([name]).map_err(EyesError::Text)?;
        Self::change(path, None)
    }

    /// Reads, changes and writes a file, while nobody else does; for nobody, all but the last.
    fn change(path: &Path, person: Option<Person>) -> Result<(), EyesError> {
        let io = |source| EyesError::Io { path: path.to_owned(), source };
        let read = || match Self::read(path) {
            Ok(eyes) => Ok(Some(eyes.0)),
            Err(EyesError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        };
        read()?;
        // Where a link leads to, the file is replaced, and not the link
        let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let folder = target.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map_err(io)?;
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let lock = folder.join(format!(".{name}.lock"));
        let lock = OpenOptions::new().create(true).truncate(false).write(true).open(lock).map_err(io)?;
        // Where there are no locks, two that end at once are the smaller evil
        drop(lock.lock());
        let people = read()?;
        let there = people.is_some();
        if there {
            // Replaced it could be even so; whoever has made it read-only did not want that
            OpenOptions::new().write(true).open(&target).map_err(io)?;
        }
        #[cfg_attr(not(unix), expect(unused_mut))]
        let mut file = tempfile::Builder::new();
        let permissions = there.then(|| std::fs::metadata(&target)).transpose().map_err(io)?;
        #[cfg(unix)]
        let shared = {
            use std::os::unix::fs::PermissionsExt;
            std::fs::Permissions::from_mode(0o666)
        };
        #[cfg(unix)]
        file.permissions(shared);
        let mut file = file.tempfile_in(folder).map_err(io)?;
        let Some(person) = person else { return Ok(()) };
        let mut people = people.unwrap_or_default();
        people.retain(|other| other.name != person.name);
        people.push(person);
        let text = Self(people).to_text()?;
        let write = || -> io::Result<()> {
            file.write_all(text.as_bytes())?;
            if let Some(permissions) = permissions {
                file.as_file().set_permissions(permissions.permissions())?;
            }
            file.as_file().sync_all()?;
            file.persist(&target)?;
            Ok(())
        };
        write().map_err(io)
    }

    /// Everybody.
    pub fn people(&self) -> &[Person] {
        &self.0
    }

    /// Those who were measured beside the model with this digest, to whose observers their factors refer;
    /// `None` if nobody was.
    pub fn beside(&self, model: &str) -> Option<Self> {
        let people: Vec<Person> = self.0.iter().filter(|person| person.model == model).cloned().collect();
        (!people.is_empty()).then_some(Self(people))
    }

    /// Whoever needs so many samples that nine of ten are content: of fewer than ten, the one who needs most.
    /// Each at the display that they sat at: finer pixels hide noise, and whoever is less demanding at a
    /// coarser display may need more.
    pub fn strictest(&self) -> &Person {
        let mut people: Vec<(u64, &Person)> = self.needs().into_iter().zip(&self.0).collect();
        people.sort_by(|(need, a), (other, b)| need.cmp(other).then(a.factor.total_cmp(&b.factor)));
        let at = (CONTENT * people.len() as f64).ceil() as usize;
        people[at.clamp(1, people.len()) - 1].1
    }

    /// Samples that each needs of the same tile; all alike at one display, where factors tell.
    fn needs(&self) -> Vec<u64> {
        let first = self.0[0].viewing();
        if self.0.iter().all(|person| person.viewing() == first) {
            return vec![0; self.0.len()];
        }
        let (oracle, noise) = (Oracle::bundled(), [1, 2].map(even_noise));
        self.0.iter().map(|person| person.need(&oracle, &noise).unwrap_or(u64::MAX)).collect()
    }
}

/// Noise of a tenth on grey, as of 64 samples per pixel.
fn even_noise(seed: u32) -> Still {
    const EDGE: u32 = 128;
    // Any numbers without a pattern do: those of a multiplicative hash, twelve of which make a normal one
    let hash = |i: u32| {
        let h = i.wrapping_mul(0x9E37_79B1) ^ seed.wrapping_mul(0x85EB_CA77);
        let h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
        let h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
        f64::from(h ^ (h >> 15)) / f64::from(u32::MAX)
    };
    let normal = |pixel: u32| (0..12).map(|i| hash(12 * pixel + i)).sum::<f64>() - 6.0;
    let pixels = (0..EDGE * EDGE).map(|pixel| [(0.2 * (1.0 + 0.1 * normal(pixel))) as f32; 3]).collect();
    let edge = EDGE as usize;
    Still::new((edge, edge), pixels, 64.0).displayed_as_it_is(0.0)
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

    /// Whoever sits nearer to coarser pixels sees more noise than one who is more demanding elsewhere.
    #[test]
    fn the_strictest_is_found_at_each_ones_display() {
        let at = |name: &str, factor: f64, pixels_per_degree: f64| {
            let person = person(name, factor);
            Person { display: SeenDisplay { pixels_per_degree, ..person.display.clone() }, ..person }
        };
        let (near, far) = (at("near", 1.0, 25.0), at("far", 1.5, 90.0));
        let noise = [1, 2].map(even_noise);
        let [one, other] = [&near, &far].map(|p| p.need(&Oracle::bundled(), &noise).unwrap());
        assert!(one > 2 * other && other > 8, "{one} {other}");
        assert_eq!(Eyes(vec![near.clone(), far.clone()]).strictest().name, "near");
        assert_eq!(Eyes(vec![far, near]).strictest().name, "near");
        let other = Person { model: "another".to_owned(), ..at("old", 9.0, 20.0) };
        let eyes = Eyes(vec![other, at("me", 1.0, 52.0)]);
        assert_eq!(eyes.beside("abc").unwrap().people(), &eyes.people()[1..]);
        assert_eq!(eyes.beside("none"), None);
    }

    #[test]
    #[cfg(unix)]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("studio.toml"), folder.path().join("eyes.toml"));
        Eyes::keep(&file, person("a", 1.0)).unwrap();
        let mode = |mode| std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).unwrap();
        mode(0o664);
        symlink(&file, &link).unwrap();
        Eyes::keep(&link, person("b", 1.0)).unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o664);
        assert_eq!(Eyes::read(&file).unwrap().people().len(), 2);
    }

    /// Two that end at once are both kept.
    #[test]
    fn nobody_is_lost_between_two_who_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("eyes.toml");
        std::thread::scope(|scope| {
            for i in 0..8 {
                let path = &path;
                scope.spawn(move || Eyes::keep(path, person(&format!("p{i}"), 1.0)).unwrap());
            }
        });
        assert_eq!(Eyes::read(&path).unwrap().people().len(), 8);
    }

    /// Before sixty questions, and not after them.
    #[test]
    fn what_could_not_be_kept_is_found_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/eyes.toml");
        Eyes::check_keep(&path, "me").unwrap();
        assert!(!path.exists(), "nobody is in it yet");
        Eyes::keep(&path, person("me", 1.0)).unwrap();
        let before = std::fs::read(&path).unwrap();
        Eyes::check_keep(&path, "you").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), before);
        let refusal = |path: &Path, name| Eyes::check_keep(path, name).unwrap_err().to_string();
        assert!(refusal(&path, "").contains("empty") && refusal(&path, "a\nb").contains("printable"));
        assert!(refusal(folder.path(), "me").contains("a folder"));
        std::fs::write(&path, "version = 2\nwho = \"me\"").unwrap();
        assert!(refusal(&path, "me").contains("version 2 of a newer noisefloor"), "{}", refusal(&path, "me"));
        let long = format!("{}\n#{}", String::from_utf8(before).unwrap(), "x".repeat(1 << 20));
        std::fs::write(&path, long).unwrap();
        assert!(refusal(&path, "me").contains("longer than a megabyte"));
    }

    #[test]
    fn nine_of_ten_are_content() {
        let strictest_tenths = |count: u32| {
            let people = (1..=count).map(|i| person(&format!("p{i}"), 0.1 * f64::from(i))).collect();
            (Eyes(people).strictest().factor * 10.0).round() as u32
        };
        assert_eq!([1, 2, 9, 10, 11, 20].map(strictest_tenths), [1, 2, 9, 9, 10, 18]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let good = toml::to_string(&Eyes(vec![person("me", 1.5)])).unwrap();
        assert!(Eyes::parse(&good).is_ok());
        let cases = [
            ("version = 1", "version = 2", "calibrate again"),
            ("version = 1", "version = 0", "calibrate again"),
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
