//! An entry for fuzzers.

use crate::call::{Described, Reply, batches, describe, most};
use crate::frame;
use crate::message::{Adapted, Hello, Sampled, Status};
use noisefloor::{Request, Tile};

const LATE: u64 = 1 << 17;

/// Reads bytes as a renderer's reply to each request there is, and says whether it is one. Not for other use.
#[doc(hidden)]
pub fn read_any_reply(mut bytes: &[u8]) -> bool {
    const PAYLOAD: usize = 12 * 64;
    let Ok(reply) = frame::read(&mut bytes, PAYLOAD) else { return false };
    let valid = serde_json::from_slice::<Status>(&reply.header).is_ok();
    if let Ok(hello) = serde_json::from_slice::<Hello>(&reply.header)
        && let Ok(Described { info, .. }) = describe(hello)
    {
        assert!(!info.name.chars().any(char::is_control));
    }
    let _ = serde_json::from_slice::<Adapted>(&reply.header);
    if let Ok(header) = serde_json::from_slice::<Sampled>(&reply.header) {
        let tile = |index| Tile { index, x: 4 * index, y: 0, width: 4, height: 4 };
        let requests = [0, 1].map(|index| Request::new(tile(index), 0, 8));
        if let Ok(batches) = batches(&requests, LATE, Reply { header, payload: reply.payload }) {
            assert!(
                batches.iter().all(
                    |b| b.spp <= most(&requests[0], LATE) && [0, b.tile.pixels()].contains(&b.mean.len())
                )
            );
        }
    }
    valid
}
