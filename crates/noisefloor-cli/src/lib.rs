//! What the two commands, `noisefloor` and `noisefloor-lab`, are made of: who renders ([`sources`]) and the
//! options that say so ([`options`]), output folders, and how they speak.
#![allow(missing_docs, reason = "parts of two commands, which have no public interface")]

pub mod bars;
pub mod build;
pub mod end;
pub mod files;
pub mod folder;
pub mod manual;
pub mod options;
pub mod say;
pub mod signals;
pub mod sources;
pub mod spell;
