//! `render --tev`: the picture in the viewer tev, tile by tile as samples arrive.

use super::saving::Pace;
use anyhow::Context;
use noisefloor::{Session, Tile};
use noisefloor_cli::say::{note, one_line};
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// Where tev listens unless it is told otherwise.
pub const ADDRESS: &str = "127.0.0.1:14158";
/// A viewer that does not take its picture for so long is given up.
const PATIENCE: Duration = Duration::from_secs(5);
const PAUSE: Duration = Duration::from_millis(500);
/// The picture, and what is known of each tile, as in image.exr.
const CHANNELS: [&str; 5] = ["R", "G", "B", "oracle.spp", "oracle.P"];

pub struct Tev {
    client: TevClient,
    name: String,
    /// Of each tile, what was shown last: its samples and its probability.
    shown: Vec<(u64, Option<f32>)>,
    pace: Pace,
}

impl Tev {
    /// Opens a black picture in a running tev.
    pub fn open(address: &str, name: &str, (width, height): (usize, usize)) -> anyhow::Result<Self> {
        let open = || {
            let found = address.to_socket_addrs()?.next();
            let found = found.ok_or_else(|| io::Error::other("no machine has this name"))?;
            let stream = TcpStream::connect_timeout(&found, PATIENCE)?;
            stream.set_write_timeout(Some(PATIENCE))?;
            let mut client = TevClient::wrap(stream);
            // Edges are below 2^17
            let (width, height) = (width as u32, height as u32);
            let name = &format!("noisefloor: {name}");
            client.send(PacketCreateImage {
                image_name: name,
                grab_focus: true,
                width,
                height,
                channel_names: &CHANNELS,
            })?;
            Ok::<_, io::Error>((client, name.clone()))
        };
        let (client, name) = open().with_context(|| {
            format!("--tev {address}: start tev first, or name the address that it listens on")
        })?;
        Ok(Self { client, name, shown: Vec::new(), pace: Pace::of_view(PAUSE) })
    }

    /// Sends the tiles that have changed, if it is time; `last`, whenever it is.
    fn show(&mut self, session: &Session, last: bool) -> io::Result<()> {
        if !last && !self.pace.is_due() {
            return Ok(());
        }
        let began = Instant::now();
        let grid = session.film().grid();
        self.shown.resize(grid.len(), (0, None));
        for tile in grid.tiles() {
            let verdict = session.verdict(tile.index).and_then(|verdict| verdict.probability);
            let now = (session.film().spp(tile.index), verdict);
            if std::mem::replace(&mut self.shown[tile.index], now) != now {
                self.send(session, tile, now)?;
            }
        }
        self.pace.pause_after(began.elapsed());
        Ok(())
    }

    fn send(
        &mut self,
        session: &Session,
        tile: Tile,
        (spp, probability): (u64, Option<f32>),
    ) -> io::Result<()> {
        let film = session.film();
        let pixels = tile.rows(film.grid().width()).flatten();
        let data: Vec<f32> = pixels
            .flat_map(|pixel| {
                let [r, g, b] = film.pixel(tile.index, pixel);
                [r, g, b, spp as f32, probability.unwrap_or(f32::NAN)]
            })
            .collect();
        let [x, y, width, height] = [tile.x, tile.y, tile.width, tile.height].map(|edge| edge as u32);
        self.client.send(PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2, 3, 4],
            channel_strides: &[5; 5],
            x,
            y,
            width,
            height,
            data: &data,
        })
    }
}

/// Shows the picture, if it is to be shown. A viewer that is closed ends the showing, and not the render.
pub fn show(tev: &mut Option<Tev>, session: &Session, last: bool) {
    if let Some(Err(error)) = tev.as_mut().map(|tev| tev.show(session, last)) {
        note!("warning: tev shows no more: {}", one_line(&error.into()));
        *tev = None;
    }
}
