//! Which device renders, of fakes: a host that has two GPUs, of which the first does not work.

use crate::kit::{FAKE, Fake};
use noisefloor::ProgressiveSource;
use noisefloor_sidecar::{Device, gpus};

#[test]
fn auto_takes_a_gpu_that_works_and_others_are_refused() {
    let Some(mut fake) = Fake::new("work") else { return };
    let identity = |fake: &Fake| fake.open().unwrap().identity().unwrap();
    let on_processor = identity(&fake);
    for (device, name) in [
        ("cpu", "Fake 1"),
        ("auto", "Fake 1 on Beta"),
        ("gpu", "Fake 1 on Beta"),
        ("1", "Fake 1 on Beta"),
        ("beta", "Fake 1 on Beta"),
        ("OptiX", "Fake 1 on Beta"),
    ] {
        fake.job.device = Some(device.parse().unwrap());
        let source = fake.open().unwrap();
        assert!(source.info().name.starts_with(name), "{device}: {}", source.info().name);
        assert_eq!(source.warnings().len(), 1, "{device}: {:?}", source.warnings());
        // What another device has rendered is not resumed
        let changed = source.identity().unwrap().change_since(&on_processor);
        assert_eq!(changed.is_some(), name != "Fake 1", "{device}");
    }
    for (device, said) in
        [("0", "Alpha (CUDA): too little memory"), ("7", "1 is Beta"), ("AMD", "0 is Alpha")]
    {
        fake.job.device = Some(device.parse().unwrap());
        let error = fake.open().unwrap_err().to_string();
        assert!(
            error.contains(&format!("device {device} cannot be used")) && error.contains(said),
            "{error}"
        );
    }
}

#[test]
fn gpus_are_listed_by_number_whatever_libraries_print() {
    let Some(fake) = Fake::new("work") else { return };
    let listed = gpus(&FAKE, &fake.python).unwrap();
    assert_eq!(listed[0], "GPU 0: Alpha (CUDA)");
    assert!(
        listed.len() == 2 && listed[1].starts_with("GPU 1: Beta") && !listed[1].contains('\x1b'),
        "{listed:?}"
    );
}

#[test]
fn words_for_devices_are_checked() {
    for text in ["auto", "cpu", "gpu", "0", "NVIDIA H200"] {
        assert_eq!(text.parse::<Device>().unwrap().to_string(), text);
    }
    assert_eq!("gpu".parse(), Ok(Device::GPU));
    for text in ["", " ", "a\nb", &"x".repeat(300)] {
        assert!(text.parse::<Device>().unwrap_err().contains("`auto`"), "{text}");
    }
}
