//! Sessions as they are stored.

use crate::event::Envelope;
use crate::session::Plan;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionRecord {
    pub code: String,
    /// Seed of the order of trials. A string in JSON: the numbers of JavaScript would round it.
    #[serde(with = "seed_as_text")]
    pub seed: u64,
    /// Group of observers; empty if the study defines none.
    pub group: String,
    /// Whether the observer is a [`SimulatedObserver`](crate::simulated::SimulatedObserver), not a person.
    pub simulated: bool,
    /// Start of the session, in milliseconds since 1970.
    pub begun_ms: u64,
    /// Opaque identifiers from the address the participant came by, for example of a recruiting service.
    #[serde(default)]
    pub ids: BTreeMap<String, String>,
    /// When each event was stored, in milliseconds since 1970.
    #[serde(default)]
    pub received_ms: Vec<u64>,
    /// The trials, as drawn when the session began.
    pub plan: Plan,
    /// All events, in order.
    pub events: Vec<Envelope>,
}

mod seed_as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(seed: &u64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(seed)
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<u64, D::Error> {
        String::deserialize(from)?.parse().map_err(D::Error::custom)
    }
}

/// A session about to begin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewSession {
    pub code: String,
    /// Seed of the order of trials.
    pub seed: u64,
    /// The trials, drawn with it.
    pub plan: Plan,
    /// Group of observers; empty if the study defines none.
    pub group: String,
    pub simulated: bool,
    /// Opaque identifiers from the address.
    pub ids: BTreeMap<String, String>,
    /// The one-time link it begins from, if any.
    pub link: Option<String>,
}
