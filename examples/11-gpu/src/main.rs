//! A path tracer on the GPU that stops when nobody sees noise, and never waits for a verdict.
//!
//! `trace.wgsl` renders; this file is the loop of the guide to embedding: samples are summed up on the card until the next
//! verdict wants them, and come back once. It runs on whatever Vulkan, Metal or DirectX 12 offers, on Mesa's software
//! device, too. Where there is none, it says so, and ends.
//!
//!     cargo run --release [WIDTH HEIGHT]      writes picture.pfm

use noisefloor::background::{Background, WhenFull};
use noisefloor::{Oracle, Params, Rgb, Schedule, Session};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::Instant;

/// Samples of a pixel in one call: a driver ends calls that take seconds, and what is rendered past a stop is that of
/// some calls.
const AT_ONCE: u32 = 4;

/// What the shader is told, as it lies in memory there.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Pass {
    width: u32,
    height: u32,
    samples: u32,
    first: u32,
    furnace: u32,
}

struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    uniforms: wgpu::Buffer,
    sums: wgpu::Buffer,
    /// Where the sums of a pass come back.
    back: wgpu::Buffer,
    pass: Pass,
    /// Samples per pixel in the sums.
    spp: u64,
}

impl Renderer {
    /// `None`, and says why, without a device.
    fn new((width, height): (u32, u32), furnace: bool) -> Result<Option<Self>, Box<dyn Error>> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = match pollster::block_on(instance.request_adapter(&options)) {
            Ok(adapter) => adapter,
            Err(error) => {
                eprintln!(
                    "skipped: no GPU and no software device ({error}); on Debian, mesa-vulkan-drivers is one"
                );
                return Ok(None);
            }
        };
        println!("on {}", adapter.get_info().name);
        let limits = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&limits))?;

        use wgpu::BufferUsages as Usage;
        let buffer = |size: usize, usage: Usage| {
            let size = size as u64;
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let bytes = (width * height) as usize * size_of::<[f32; 4]>();
        // A uniform is as long as a multiple of 16
        let uniforms = buffer(size_of::<Pass>().next_multiple_of(16), Usage::UNIFORM | Usage::COPY_DST);
        let sums = buffer(bytes, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST);
        let back = buffer(bytes, Usage::MAP_READ | Usage::COPY_DST);
        let module = device.create_shader_module(wgpu::include_wgsl!("trace.wgsl"));
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("trace"),
            compilation_options: Default::default(),
            cache: None,
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: sums.as_entire_binding() },
            ],
        });
        let pass = Pass { width, height, samples: 0, first: 0, furnace: furnace.into() };
        Ok(Some(Self { device, queue, pipeline, bindings, uniforms, sums, back, pass, spp: 0 }))
    }

    /// Adds new samples of each pixel to the sums on the device, and waits for them.
    fn add(&mut self, samples: u32) -> Result<(), Box<dyn Error>> {
        self.pass.samples = samples;
        self.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&self.pass));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut compute = encoder.begin_compute_pass(&Default::default());
        compute.set_pipeline(&self.pipeline);
        compute.set_bind_group(0, &self.bindings, &[]);
        compute.dispatch_workgroups(self.pass.width.div_ceil(8), self.pass.height.div_ceil(8), 1);
        drop(compute);
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        // Samples are numbered here: a session in the background lags behind
        self.pass.first += samples;
        self.spp += u64::from(samples);
        Ok(())
    }

    /// Reads back the mean of what was summed up, and its samples per pixel. The sums begin anew.
    fn take(&mut self, image: &mut [Rgb]) -> Result<u64, Box<dyn Error>> {
        let mut copy = self.device.create_command_encoder(&Default::default());
        copy.copy_buffer_to_buffer(&self.sums, 0, &self.back, 0, self.back.size());
        copy.clear_buffer(&self.sums, 0, None);
        self.queue.submit([copy.finish()]);
        let (send, receive) = std::sync::mpsc::channel();
        // Whoever waits is there: nothing to do if not
        self.back.map_async(wgpu::MapMode::Read, .., move |mapped| drop(send.send(mapped)));
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        receive.recv()??;
        let mapped = self.back.get_mapped_range(..)?;
        let sums: &[[f32; 4]] = bytemuck::cast_slice(&mapped);
        for (pixel, &[r, g, b, _]) in image.iter_mut().zip(sums) {
            *pixel = [r, g, b].map(|sum| sum / self.spp as f32);
        }
        drop(mapped);
        self.back.unmap();
        Ok(std::mem::take(&mut self.spp))
    }
}

/// Renders until nobody sees noise.
fn picture(size: (u32, u32)) -> Result<Option<Vec<Rgb>>, Box<dyn Error>> {
    let Some(mut renderer) = Renderer::new(size, false)? else { return Ok(None) };
    let params = Params::default().with_tile(64).with_schedule(Schedule::Growing { step: 16 });
    let session = Session::new(size.0 as usize, size.1 as usize, Oracle::bundled(), params)?;
    let background = Background::new(session, 1, WhenFull::Wait)?;
    let start = Instant::now();
    while let Some(wanted) = background.next_pass() {
        if renderer.spp >= wanted && background.pending() == 0 {
            let mut image = background.buffer();
            let spp = renderer.take(&mut image)?;
            background.push_image(spp, image)?;
            background.judge()?;
        }
        let news = if renderer.spp < background.spp_left() {
            renderer.add(AT_ONCE)?;
            background.news()?
        } else {
            background.finish()?
        };
        news.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        if !news.stops.is_empty() {
            let (seconds, open) = (start.elapsed().as_secs_f64(), background.requests().len());
            println!("{seconds:6.1} s, {} samples per pixel: {open} tiles are open", renderer.pass.first);
        }
    }
    background.finish()?;
    Ok(Some(background.into_session()?.film().image()))
}

/// A PFM file: linear radiance, rows from the bottom.
fn write(path: &str, (width, height): (u32, u32), image: &[Rgb]) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    write!(file, "PF\n{width} {height}\n-1.0\n")?;
    for row in image.chunks_exact(width as usize).rev() {
        file.write_all(bytemuck::cast_slice(row))?;
    }
    file.flush()
}

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u32> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let size = match numbers[..] {
        [] => (960, 540),
        [width, height] => (width, height),
        _ => return Err("usage: example-gpu [WIDTH HEIGHT]".into()),
    };
    if let Some(image) = picture(size)? {
        write("picture.pfm", size, &image)?;
        println!("picture.pfm");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of albedo 1/2 under a white sky, which sees nothing of itself, is 1/2 everywhere; the sky is 1. No
    /// sample is off: there is no noise.
    #[test]
    fn the_furnace_is_as_bright_as_it_must_be() {
        let size = (64, 48);
        let Some(mut renderer) = Renderer::new(size, true).expect("a device that works") else { return };
        let mut image = vec![[0.0; 3]; 64 * 48];
        (0..10).for_each(|_| renderer.add(4).expect("samples"));
        assert_eq!(renderer.take(&mut image).expect("a pass"), 40);
        let at = |x: usize, y: usize| image[y * 64 + x];
        assert_eq!((at(0, 0), at(63, 47)), ([1.0; 3], [1.0; 3]));
        for (x, y) in [(32, 24), (28, 20), (36, 30)] {
            assert!(at(x, y).iter().all(|c| (c - 0.5).abs() < 1e-5), "{:?}", at(x, y));
        }
    }

    /// Passes are independent, and their mean does not depend on how they are cut.
    #[test]
    fn passes_are_new_samples_of_one_picture() {
        let size = (64, 64);
        let Some(mut renderer) = Renderer::new(size, false).expect("a device that works") else { return };
        let mut pass = |spp| {
            let mut image = vec![[0.0f32; 3]; 64 * 64];
            (0..spp / 16).for_each(|_| renderer.add(16).expect("samples"));
            renderer.take(&mut image).expect("a pass");
            image
        };
        let (a, b, long) = (pass(64), pass(64), pass(512));
        let mean =
            |image: &[Rgb]| image.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / image.len() as f64;
        let apart = |a: &[Rgb], b: &[Rgb]| {
            let squares = a.iter().zip(b).map(|(a, b)| f64::from(a[1] - b[1]).powi(2));
            squares.sum::<f64>() / a.len() as f64
        };
        // Var(a − b) = 2σ²/64, and Var(a − long) = σ²(1/64 + 1/512): 0.5625 of it, by 4,096 pixels to a few per cent
        let ratio = apart(&a, &long) / apart(&a, &b);
        assert!((0.45..0.7).contains(&ratio), "{ratio}");
        assert!((mean(&a) / mean(&long) - 1.0).abs() < 0.02, "{} {}", mean(&a), mean(&long));
    }

    #[test]
    fn a_picture_is_done() {
        let Some(image) = picture((128, 64)).expect("a device that works") else { return };
        assert!(image.iter().flatten().all(|c| c.is_finite() && *c >= 0.0));
        assert!(image.iter().any(|pixel| pixel[0] > 0.1));
    }
}
