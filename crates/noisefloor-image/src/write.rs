//! Files that appear whole or not at all.

use crate::error::WriteError;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
    LineOrder, Text, WritableImage,
};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use noisefloor::{Rgb, check_image};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file through a temporary one in the same folder, which takes its name once it is complete and on disk.
///
/// Whatever fails, or if the process is killed, a file that was there before stays as it was. (After a kill, a hidden
/// `.noisefloor-*.tmp` may be left behind.) A symbolic link stays, and the file it points to is replaced. The writer is
/// buffered, can seek, and is flushed for you.
///
/// ```
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("stops.csv");
/// noisefloor_image::write_atomic(&path, |writer| writeln!(writer, "tile,spp"))?;
/// assert_eq!(std::fs::read_to_string(path)?, "tile,spp\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`WriteError::Folder`] if its folder is not there or not writable, [`WriteError::NotAFile`] if the path is a folder or a
/// device, [`WriteError::Failed`] with the cause if `write` failed or the disk is full.
pub fn write_atomic<E>(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), WriteError>
where
    E: Into<Box<dyn Error + Send + Sync>>,
{
    let path = path.as_ref();
    let failed = |source: Box<dyn Error + Send + Sync>| WriteError::Failed { path: path.to_owned(), source };

    let place = Place::find(path)?;

    // Write beside it
    let mut temporary = place.temporary()?;
    let mut writer = BufWriter::new(temporary.as_file_mut());
    write(&mut writer).map_err(|e| failed(e.into()))?;
    writer.flush().map_err(|e| failed(e.into()))?;
    drop(writer);

    // Complete on disk, then under its name
    temporary.as_file().sync_all().map_err(|e| failed(e.into()))?;
    temporary.persist(&place.target).map_err(|e| failed(e.error.into()))?;
    Ok(())
}

/// Where a file is to go.
struct Place<'a> {
    path: &'a Path,
    /// Behind symbolic links.
    target: PathBuf,
    folder: PathBuf,
}

impl<'a> Place<'a> {
    /// Never in place of a folder or a device.
    fn find(path: &'a Path) -> Result<Self, WriteError> {
        let failed = |e: std::io::Error| WriteError::Failed { path: path.to_owned(), source: e.into() };
        let target = match std::fs::metadata(path) {
            Ok(meta) if meta.is_file() => std::fs::canonicalize(path).map_err(failed)?,
            Ok(_) => return Err(WriteError::NotAFile { path: path.to_owned() }),
            Err(_) => path.to_owned(),
        };
        if target.file_name().is_none() {
            return Err(WriteError::NotAFile { path: path.to_owned() });
        }
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        Ok(Self { path, target, folder })
    }

    fn temporary(&self) -> Result<tempfile::NamedTempFile, WriteError> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".noisefloor-").suffix(".tmp");
        #[cfg(unix)]
        {
            // As any new file: what the umask leaves, not the owner alone as is usual for temporary files
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let (path, folder) = (self.path.to_owned(), self.folder.clone());
        builder.tempfile_in(&self.folder).map_err(|source| WriteError::Folder { path, folder, source })
    }
}

/// Checks that a file could be written there, for commands that would work for hours before they do. Writes nothing.
///
/// # Errors
/// Those of [`write_atomic`].
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), WriteError> {
    Place::find(path.as_ref()).and_then(|place| place.temporary()).map(drop)
}

/// A render and what the oracle knows about each of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct RenderLayers<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear RGB, Rec.709, row-major, `width * height` values.
    pub rgb: &'a [Rgb],
    /// Samples behind each pixel; written as 32-bit unsigned integers `oracle.spp`.
    pub spp: Option<&'a [u32]>,
    /// Probability, 0…1, that an observer sees no difference; written as floats `oracle.P`. NaN where nobody judged.
    pub probability: Option<&'a [f32]>,
    /// Whether the pixel's tile has stopped; written as floats `oracle.stop`, 1 or 0.
    pub stopped: Option<&'a [bool]>,
    /// How visible the noise is, in 8-bit display steps; written as floats `oracle.visible_noise`. NaN where there is no evidence.
    pub visible_noise: Option<&'a [f32]>,
}

impl<'a> RenderLayers<'a> {
    /// A picture without extra layers.
    pub fn rgb(width: usize, height: usize, rgb: &'a [Rgb]) -> Self {
        Self { width, height, rgb, spp: None, probability: None, stopped: None, visible_noise: None }
    }
}

/// Writes a linear EXR, atomically: one part, ZIP, scan lines; R, G and B as 32-bit floats in the unnamed layer, which is what
/// every viewer shows, and what the oracle knows in the channels of a layer `oracle`.
///
/// # Errors
/// [`WriteError`] if a slice does not hold one value a pixel, the image is empty or too large, or as of [`write_atomic`].
pub fn write_exr(path: impl AsRef<Path>, layers: &RenderLayers<'_>) -> Result<(), WriteError> {
    let path = path.as_ref();
    let (width, height) = (layers.width, layers.height);
    check_image(width, height).map_err(|source| WriteError::Image { path: path.to_owned(), source })?;
    let check = |what, got: usize| check_len(path, what, (width, height), got, width * height);

    // Colours
    check("rgb", layers.rgb.len())?;
    let colour = |c: usize| FlatSamples::F32(layers.rgb.iter().map(|pixel| pixel[c]).collect());
    let mut channels = vec![
        AnyChannel::new("R", colour(0)),
        AnyChannel::new("G", colour(1)),
        AnyChannel::new("B", colour(2)),
    ];

    // What the oracle knows
    if let Some(spp) = layers.spp {
        check("spp", spp.len())?;
        channels.push(AnyChannel::new("oracle.spp", FlatSamples::U32(spp.to_vec())));
    }
    if let Some(probability) = layers.probability {
        check("probability", probability.len())?;
        channels.push(AnyChannel::new("oracle.P", FlatSamples::F32(probability.to_vec())));
    }
    if let Some(stopped) = layers.stopped {
        check("stopped", stopped.len())?;
        let stopped = stopped.iter().map(|&s| f32::from(u8::from(s))).collect();
        channels.push(AnyChannel::new("oracle.stop", FlatSamples::F32(stopped)));
    }
    if let Some(noise) = layers.visible_noise {
        check("visible_noise", noise.len())?;
        channels.push(AnyChannel::new("oracle.visible_noise", FlatSamples::F32(noise.to_vec())));
    }

    let attributes =
        LayerAttributes { software_name: Some(Text::from("noisefloor")), ..LayerAttributes::default() };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let image = Image::from_layer(Layer::new((width, height), attributes, encoding, channels));
    write_atomic(path, |writer| image.write().to_buffered(writer))
}

/// Writes an 8-bit RGB PNG, atomically. `rgb` is sRGB-encoded, row-major, three bytes a pixel.
///
/// # Errors
/// [`WriteError`] if `rgb` does not hold three bytes a pixel, the image is empty or too large, or as of [`write_atomic`].
pub fn write_png(path: impl AsRef<Path>, width: usize, height: usize, rgb: &[u8]) -> Result<(), WriteError> {
    let path = path.as_ref();
    check_image(width, height).map_err(|source| WriteError::Image { path: path.to_owned(), source })?;
    check_len(path, "rgb", (width, height), rgb.len(), width * height * 3)?;
    write_atomic(path, |writer| {
        // check_image: both edges fit into 32 bits
        PngEncoder::new(writer).write_image(rgb, width as u32, height as u32, ExtendedColorType::Rgb8)
    })
}

fn check_len(
    path: &Path,
    what: &'static str,
    (width, height): (usize, usize),
    got: usize,
    want: usize,
) -> Result<(), WriteError> {
    if got == want {
        return Ok(());
    }
    Err(WriteError::Size { path: path.to_owned(), what, width, height, got, want })
}
