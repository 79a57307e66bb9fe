//! Shards of a farm: the bytes are the header; magic, version, length and checksum are right, and samples follow.

use crate::files::{Folder, HEADER, content, framed};
use noisefloor::{FixedSpp, Params, Session, source::SourceIdentity};
use noisefloor_farm::{PlannedBatch, Shard, ShardJob, ShardSet};

fn wrap(whole: &[u8], header: &[u8]) -> Vec<u8> {
    [&framed(whole, header), &whole[HEADER + content(whole).len()..]].concat()
}

pub(crate) fn shard(header: &[u8]) -> bool {
    thread_local!(static BEFORE: (Folder, Vec<u8>) = (Folder::new(), written()));
    BEFORE.with(|(folder, whole)| merge(folder, &wrap(whole, header)) > 0)
}

/// Samples that come of a shard.
fn merge(folder: &Folder, bytes: &[u8]) -> u64 {
    let path = folder.write("shard.nfs", bytes);
    let mut session = session();
    let mut shards = ShardSet::gather(&job(&session), &[path]);
    shards.merge_into(&mut session).map_or(0, |merged| merged.samples)
}

pub(crate) fn shard_seeds() -> Vec<Vec<u8>> {
    vec![content(&written()).to_vec()]
}

fn session() -> Session<FixedSpp> {
    let params = Params::default().with_tile(32);
    Session::new(48, 32, FixedSpp(100), params).expect("a small picture")
}

fn job(session: &Session<FixedSpp>) -> ShardJob {
    ShardJob::of(SourceIdentity::new("grey"), session)
}

/// A shard with samples for both tiles.
fn written() -> Vec<u8> {
    let session = session();
    let mut shard = Shard::new(job(&session));
    for batch in PlannedBatch::ahead(&session) {
        let (spp, pixels) = (batch.spp, session.film().grid().tile(batch.tile).pixels());
        shard.add(batch, spp, vec![[0.5; 3]; pixels]);
    }
    let folder = Folder::new();
    let path = folder.write("new.nfs", "");
    shard.write(&path).expect("space for a shard");
    std::fs::read(path).expect("what was just written")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_merged() {
        let whole = written();
        let again = wrap(&whole, content(&whole));
        let planned: u64 = PlannedBatch::ahead(&session()).iter().map(|b| b.spp).sum();
        // Two tiles of 32 and of 16 by 32 pixels, with as many samples per pixel
        assert_eq!(merge(&Folder::new(), &again), planned / 2 * 48 * 32);
    }
}
