use crate::kit::{command, fail, run, stderr, text, tiny};
use noisefloor_image::read_exr;
use noisefloor_testkit::HANG;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Stdio;
use std::thread;
use std::time::Duration;
use tempfile::tempdir;

/// A packet of tev's protocol, read from its start.
struct Packet<'a>(&'a [u8]);

impl<'a> Packet<'a> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (taken, rest) = self.0.split_at(N);
        self.0 = rest;
        taken.try_into().unwrap()
    }

    fn number(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn name(&mut self) -> &'a str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap();
        let (name, rest) = self.0.split_at(end);
        self.0 = &rest[1..];
        std::str::from_utf8(name).unwrap()
    }

    fn floats(self) -> Vec<f32> {
        self.0.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    }
}

/// What tev would show: width, and R, G, B, samples and probability of each pixel.
fn shown(mut bytes: &[u8]) -> (usize, Vec<[f32; 5]>) {
    let (mut width, mut pixels) = (0, Vec::new());
    while !bytes.is_empty() {
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        let mut packet = Packet(&bytes[4..length]);
        bytes = &bytes[length..];
        let [kind, _grab] = packet.take();
        assert_eq!(packet.name(), "noisefloor: cornell-box");
        if kind == 4 {
            let size = [packet.number() as usize, packet.number() as usize];
            (width, pixels) = (size[0], vec![[0.0; 5]; size[0] * size[1]]);
            continue;
        }
        assert_eq!((kind, packet.number()), (6, 5));
        let names: Vec<&str> = (0..5).map(|_| packet.name()).collect();
        assert_eq!(names, ["R", "G", "B", "oracle.spp", "oracle.P"]);
        let [left, top, tile, _height] = [(); 4].map(|()| packet.number() as usize);
        let _places: [u8; 80] = packet.take();
        for (at, values) in packet.floats().as_chunks().0.iter().enumerate() {
            pixels[(top + at / tile) * width + left + at % tile] = *values;
        }
    }
    (width, pixels)
}

#[test]
fn tev_is_sent_what_is_in_the_file() {
    let folder = tempdir().unwrap();
    let tev = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--tev={}", tev.local_addr().unwrap());
    let viewer = thread::spawn(move || {
        let mut bytes = Vec::new();
        tev.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
        bytes
    });
    let output = run(&tiny(text(folder.path()), &[&address]));
    assert!(output.status.success(), "{}", stderr(&output));
    let (width, pixels) = shown(&viewer.join().unwrap());
    let image = read_exr(folder.path().join("image.exr")).unwrap();
    assert_eq!((width, pixels.len()), (64, 64 * 64));
    assert!(pixels.iter().zip(&image.pixels).all(|(shown, kept)| shown[..3] == kept[..]));
    assert!(pixels.iter().all(|shown| shown[3] >= 16.0 && (0.0..=1.0).contains(&shown[4])));
}

#[test]
fn a_viewer_that_is_not_there_is_an_error_and_one_that_goes_is_not() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--tev={}", nobody.local_addr().unwrap());
    let leaving = thread::spawn(move || drop(nobody.accept().unwrap()));
    let output = run(&tiny(out, &[&address]));
    assert!(output.status.success() && stderr(&output).contains("tev shows no more"), "{}", stderr(&output));
    leaving.join().unwrap();
    // The listener is gone
    fail(&tiny(out, &[&address, "--force"]), &["--tev 127.0.0.1:", "start tev first"]);
}

/// The reply to a GET: its status, and its body.
fn get(address: SocketAddr, path: &str, host: &str) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(HANG)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut reply = Vec::new();
    stream.read_to_end(&mut reply).unwrap();
    let body = reply.windows(4).position(|bytes| bytes == b"\r\n\r\n").unwrap() + 4;
    let status = std::str::from_utf8(&reply[9..12]).unwrap().parse().unwrap();
    (status, reply.split_off(body))
}

#[test]
fn a_render_is_watched_on_a_page() {
    let folder = tempdir().unwrap();
    let args =
        ["render", "--size", "64x64", "--tile", "32", "--criterion", "spp:1000000000", "--threads", "1"];
    let mut child = command(&[&args[..], &["--watch=127.0.0.1:0", "--out", text(folder.path())]].concat())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let line = lines.next().unwrap().unwrap();
    let address: SocketAddr = line.strip_prefix("watch it at http://").unwrap().parse().unwrap();
    let host = address.to_string();
    let (status, page) = get(address, "/", &host);
    assert!(status == 200 && page.starts_with(b"<!doctype html>"), "{status}");
    // A page that asks for the state is shown a picture soon
    let mut state = serde_json::Value::Null;
    for _ in 0..200 {
        state = serde_json::from_slice(&get(address, "/api/state", &host).1).unwrap();
        if state["picture"].as_u64() > Some(0) {
            break;
        }
        thread::sleep(Duration::from_millis(50));
    }
    assert_eq!((state["width"].as_u64(), state["tiles"].as_array().unwrap().len()), (Some(64), 4), "{state}");
    assert!(state["tiles"][3]["spp"].as_u64() > Some(0) && state["tiles"][3]["open"] == true, "{state}");
    let (status, picture) = get(address, "/api/picture.png", &host);
    assert!(status == 200 && picture.starts_with(b"\x89PNG"), "{status}");
    // A page elsewhere whose name leads to this machine
    assert_eq!(get(address, "/api/state", "elsewhere.example").0, 421);
    child.kill().unwrap();
    child.wait().unwrap();
}
