//! Disagreements on disk. One is acknowledged only after its transaction has been committed with
//! `synchronous = FULL` in a write-ahead log.

use crate::error::StoreError;
use crate::store::{Kind, Mode, now_ms};
use noisefloor::{
    descriptor::{Descriptor, DescriptorSpec},
    evidence::Evidence,
};
use noisefloor_learn::Answer;
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Disagreements: "nfex".
const DISAGREEMENTS: Kind = Kind {
    application: 0x6e66_6578,
    version: 1,
    other: || StoreError::NotDisagreements,
    tables: "
CREATE TABLE IF NOT EXISTS disagreements (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    picture TEXT NOT NULL, name TEXT NOT NULL, scene TEXT NOT NULL, spp REAL NOT NULL,
    x INTEGER NOT NULL, y INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,
    sees_noise INTEGER NOT NULL, at_ms INTEGER NOT NULL,
    probability REAL NOT NULL, threshold REAL NOT NULL, slope REAL NOT NULL, offset REAL NOT NULL,
    model TEXT NOT NULL,
    descriptor TEXT NOT NULL, descriptor_version INTEGER NOT NULL, evidence TEXT NOT NULL,
    numbers TEXT NOT NULL,
    UNIQUE (picture, x, y, width, height)
) STRICT;",
};

/// What somebody said about a tile, and what the model had said.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TileAnswer {
    /// Digest of the picture file, hexadecimal.
    pub picture: String,
    pub name: String,
    /// Name of the scene. Pictures of one scene are held out together.
    pub scene: String,
    pub spp: f64,
    /// The tile: x, y, width and height in pixels.
    pub tile: [usize; 4],
    pub sees_noise: bool,
    /// P as displayed, in [0, 1].
    pub probability: f32,
    /// P from which the tile counted as converged.
    pub threshold: f32,
    /// Slope and offset of the audience that P was computed for.
    pub audience: [f64; 2],
    /// Digest of the model.
    pub model: String,
    /// The descriptor computed for the tile.
    pub descriptor: DescriptorSpec,
    pub descriptor_version: u16,
    /// What the tile was compared with.
    pub evidence: Evidence,
    pub numbers: Vec<f32>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Disagreement {
    pub id: i64,
    /// Time of storage, in milliseconds since 1970.
    pub at_ms: u64,
    #[serde(flatten)]
    pub said: TileAnswer,
}

impl TileAnswer {
    /// Converts the answer to a training example.
    pub fn answer(&self) -> Answer {
        let (group, spp) = (self.scene.clone(), self.spp);
        Answer { group, spp, descriptor: self.numbers.clone(), sees_noise: self.sees_noise }
    }

    /// Whether the answer can be trained on together with a table of this kind.
    pub fn fits(&self, descriptor: &Descriptor, evidence: Evidence) -> bool {
        (&self.descriptor, self.descriptor_version, self.evidence)
            == (&descriptor.spec(), descriptor.version(), evidence)
    }
}

#[derive(Debug)]
pub struct Disagreements {
    path: PathBuf,
    connection: Mutex<Connection>,
}

impl Disagreements {
    /// Opens the database, creating it if needed.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, StoreError> {
        let path = path.as_ref().to_owned();
        let connection = DISAGREEMENTS.open(&path, Mode::Create).map_err(|fault| fault.at(&path))?;
        Ok(Self { path, connection: Mutex::new(connection) })
    }

    /// Stores an answer, replacing an earlier one about the same tile. It is on disk when this returns.
    /// Returns the row number, and the earlier answer, if any.
    pub fn keep(&self, said: &TileAnswer) -> Result<(i64, Option<bool>), StoreError> {
        let text = |value: serde_json::Result<String>| value.unwrap_or_default();
        let [x, y, width, height] = said.tile;
        let tile = params![said.picture, x, y, width, height];
        let before = "SELECT sees_noise FROM disagreements \
            WHERE picture = ?1 AND x = ?2 AND y = ?3 AND width = ?4 AND height = ?5";
        let insert = "INSERT OR REPLACE INTO disagreements VALUES (NULL, ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, \
            ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19)";
        let row = params![
            said.picture,
            said.name,
            said.scene,
            said.spp,
            x,
            y,
            width,
            height,
            said.sees_noise,
            now_ms(),
            said.probability,
            said.threshold,
            said.audience[0],
            said.audience[1],
            said.model,
            text(serde_json::to_string(&said.descriptor)),
            said.descriptor_version,
            text(serde_json::to_string(&said.evidence)),
            text(serde_json::to_string(&said.numbers)),
        ];
        self.within(|connection| {
            let transaction = connection.unchecked_transaction()?;
            let before = transaction.query_row(before, tile, |row| row.get(0)).optional()?;
            transaction.execute(insert, row)?;
            let id = transaction.last_insert_rowid();
            transaction.commit()?;
            Ok((id, before))
        })
    }

    /// Sets the scene of all answers about these pictures, whatever it was called when they were given.
    pub(crate) fn name_scene(&self, pictures: &[String], scene: &str) -> Result<(), StoreError> {
        self.within(|connection| {
            let transaction = connection.unchecked_transaction()?;
            for picture in pictures {
                let update = "UPDATE disagreements SET scene = ?2 WHERE picture = ?1 AND scene <> ?2";
                transaction.execute(update, [picture.as_str(), scene])?;
            }
            transaction.commit()
        })
    }

    /// Deletes an answer; returns false if it does not exist.
    pub(crate) fn take_back(&self, id: i64) -> Result<bool, StoreError> {
        let delete = "DELETE FROM disagreements WHERE id = ?1";
        self.within(|connection| Ok(connection.execute(delete, [id])? > 0))
    }

    /// All answers, oldest first.
    pub fn all(&self) -> Result<Vec<Disagreement>, StoreError> {
        self.within(read)
    }

    fn within<T>(&self, work: impl FnOnce(&Connection) -> rusqlite::Result<T>) -> Result<T, StoreError> {
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        work(&connection).map_err(|fault| StoreError::from(fault).at(&self.path))
    }
}

/// All disagreements of a database, oldest first. The database may be in use.
pub fn read_answers(path: impl AsRef<Path>) -> Result<Vec<Disagreement>, StoreError> {
    let path = path.as_ref();
    let found = DISAGREEMENTS.open(path, Mode::Existing).and_then(|connection| Ok(read(&connection)?));
    found.map_err(|fault| fault.at(path))
}

fn read(connection: &Connection) -> rusqlite::Result<Vec<Disagreement>> {
    let mut statement = connection.prepare("SELECT * FROM disagreements ORDER BY id")?;
    statement.query_map([], row)?.collect()
}

fn row(row: &Row<'_>) -> rusqlite::Result<Disagreement> {
    fn json<T: serde::de::DeserializeOwned>(row: &Row<'_>, at: usize) -> rusqlite::Result<T> {
        let text: String = row.get(at)?;
        let bad = |e| rusqlite::Error::FromSqlConversionFailure(at, rusqlite::types::Type::Text, Box::new(e));
        serde_json::from_str(&text).map_err(bad)
    }
    let said = TileAnswer {
        picture: row.get(1)?,
        name: row.get(2)?,
        scene: row.get(3)?,
        spp: row.get(4)?,
        tile: [row.get(5)?, row.get(6)?, row.get(7)?, row.get(8)?],
        sees_noise: row.get(9)?,
        probability: row.get(11)?,
        threshold: row.get(12)?,
        audience: [row.get(13)?, row.get(14)?],
        model: row.get(15)?,
        descriptor: json(row, 16)?,
        descriptor_version: row.get(17)?,
        evidence: json(row, 18)?,
        numbers: json(row, 19)?,
    };
    Ok(Disagreement { id: row.get(0)?, at_ms: row.get(10)?, said })
}
