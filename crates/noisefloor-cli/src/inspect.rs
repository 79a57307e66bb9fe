//! `noisefloor inspect` and `noisefloor scenes`.

use crate::args::{InspectArgs, load_model};
use noisefloor::{Audience, DescriptorSpec, Evidence, Scores, ToneMapping, TrainingRecord};
use noisefloor_ptwne::scenes;
use serde::Serialize;

/// What there is to say of a model, without its numbers.
#[derive(Serialize)]
struct Summary<'a> {
    digest: String,
    descriptor: DescriptorSpec,
    descriptor_version: u16,
    numbers: usize,
    evidence: Evidence,
    tone_mapping: ToneMapping,
    support_vectors: usize,
    gamma: f32,
    /// Zones whose texture is familiar, and how far around them it still is, in standard deviations; null if all is.
    familiar_zones: Option<usize>,
    familiar_reach: Option<f32>,
    audience: Audience,
    record: &'a TrainingRecord,
}

pub fn run(args: &InspectArgs) -> anyhow::Result<()> {
    let model = load_model(args.model.as_deref())?;
    let (descriptor, svm, record) = (model.descriptor(), &model.classifier().svm, model.record());
    let summary = Summary {
        digest: model.digest(),
        descriptor: descriptor.spec(),
        descriptor_version: descriptor.version(),
        numbers: descriptor.dimensions(),
        evidence: model.evidence(),
        tone_mapping: model.tone_mapping(),
        support_vectors: svm.coefficients.len(),
        gamma: svm.gamma,
        familiar_zones: model.familiarity().map(|f| f.zones.len()),
        familiar_reach: model.familiarity().map(|f| f.reach),
        audience: model.audience(),
        record,
    };
    if args.json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
        return Ok(());
    }
    println!("digest           {}", summary.digest);
    println!(
        "descriptor       {} (version {}), {} numbers",
        descriptor.name(),
        summary.descriptor_version,
        summary.numbers
    );
    println!(
        "evidence         {}",
        match model.evidence() {
            Evidence::Halves => "the other half buffer",
            Evidence::Alone => "none: the picture alone",
            Evidence::Reference => "a ray-traced reference",
        }
    );
    println!(
        "trained through  {}",
        match model.tone_mapping() {
            ToneMapping::Srgb { exposure } => format!("plain sRGB, exposure {exposure}"),
            ToneMapping::Reinhard { key, white: None } => format!("Reinhard, key {key}"),
            ToneMapping::Reinhard { key, white: Some(white) } =>
                format!("Reinhard, key {key}, white {white}"),
        }
    );
    println!(
        "machine          C-SVC, RBF kernel, C = {}, γ = {}; {} support vectors of {} examples",
        record.c, record.gamma, summary.support_vectors, record.examples
    );
    if let (Some(zones), Some(reach)) = (summary.familiar_zones, summary.familiar_reach) {
        println!(
            "familiar         {zones} zones, and textures within {reach:.3} standard deviations of them"
        );
    }
    println!("audience         T' = {} T + {}", model.audience().slope, model.audience().offset);
    println!("trained on       {}", record.corpus);
    println!("scenes           {}", record.scenes.join(", "));
    println!("table            {}", record.table_digest);
    match record.leave_one_scene_out {
        Some(Scores { zones, error_factor, bias_factor, early_share }) => println!(
            "left-out scenes  {zones} zones: error factor {error_factor:.3}, bias factor {bias_factor:.3}, {:.1} % stopped below half",
            100.0 * early_share
        ),
        None => println!("left-out scenes  not scored"),
    }
    Ok(())
}

pub fn scenes() {
    let show = |heading, scenes: &mut dyn Iterator<Item = scenes::BuiltInScene>| {
        println!("{heading}");
        for scene in scenes {
            println!("  {:16} {}", scene.name, scene.description);
        }
    };
    show("Scenes to render:", &mut scenes::list());
    show("Stiff scenes, each hard on a renderer:", &mut scenes::stiff());
}
