//! The table as CSV: a comment line that says what it holds, a header, a line a level.

use crate::error::TableError;
use crate::stimulus::parse_reference;
use crate::table::{Level, Origin, Table, Zone};
use csv::{ReaderBuilder, StringRecord, Writer};
use noisefloor::{
    ToneMapping, Viewing,
    descriptor::{Descriptor, DescriptorKind, DescriptorSpec},
    evidence::Evidence,
};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::io::{Read, Write};

/// Longest table that is read, in bytes.
const MAX_BYTES: u64 = 1 << 30;
const COLUMNS: [&str; 11] = [
    "scene",
    "group",
    "zone",
    "human_spp",
    "censored",
    "first_spp",
    "last_spp",
    "reference_spp",
    "spp",
    "origin",
    "noise",
];
const MARK: &str = "# noisefloor table ";

#[derive(Serialize, Deserialize)]
struct Head {
    descriptor: DescriptorSpec,
    descriptor_version: u16,
    evidence: Evidence,
    tone_mapping: ToneMapping,
    /// Tables of earlier releases assume the default without saying so.
    #[serde(default)]
    viewing: Viewing,
}

pub fn write_table(table: &Table, mut to: impl Write) -> Result<(), TableError> {
    let head = Head {
        descriptor: table.descriptor.spec(),
        descriptor_version: table.descriptor.version(),
        evidence: table.evidence,
        tone_mapping: table.tone_mapping.clone(),
        viewing: table.viewing,
    };
    let head = serde_json::to_string(&head).map_err(std::io::Error::from).map_err(csv::Error::from)?;
    writeln!(to, "{MARK}{head}").map_err(csv::Error::from)?;
    let mut csv = Writer::from_writer(to);
    csv.write_record(COLUMNS.map(str::to_owned).into_iter().chain(table.descriptor.number_names()))?;
    for zone in &table.zones {
        for level in &zone.levels {
            let origin = match level.origin {
                Origin::Real => "real",
                Origin::Synthesised => "synthesised",
            };
            let fixed = [
                zone.scene.clone(),
                zone.group.clone(),
                zone.zone.to_string(),
                zone.human_spp.to_string(),
                zone.censored.to_string(),
                zone.first_spp.to_string(),
                zone.last_spp.to_string(),
                zone.reference_spp.to_string(),
                level.spp.to_string(),
                origin.to_owned(),
                level.noise.to_string(),
            ];
            // `to_string` of a float is the shortest text that reads back to the same bits.
            csv.write_record(fixed.into_iter().chain(level.descriptor.iter().map(f32::to_string)))?;
        }
    }
    csv.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// Reads a table that [`write_table`] wrote, with a built-in descriptor.
pub fn read_table(from: impl Read) -> Result<Table, TableError> {
    read_table_with(from, &[])
}

/// Reads a table whose descriptor is one of `kinds`, or built in.
pub fn read_table_with(from: impl Read, kinds: &[DescriptorKind]) -> Result<Table, TableError> {
    // What it holds.
    let mut text = String::new();
    from.take(MAX_BYTES).read_to_string(&mut text).map_err(csv::Error::from)?;
    let bad = |line: u64, what: &str| TableError::Row { line, what: what.to_owned() };
    let (head, rows) = text.split_once('\n').unwrap_or((&text, ""));
    let head = head.strip_prefix(MARK).ok_or_else(|| {
        bad(1, "this is not a table of descriptors: it does not begin with \"# noisefloor table\"")
    })?;
    let head: Head = serde_json::from_str(head).map_err(|e| bad(1, &e.to_string()))?;
    let Head { descriptor, descriptor_version, evidence, tone_mapping, viewing } = head;
    let descriptor = Descriptor::from_spec(&descriptor, kinds).map_err(|e| bad(1, &e.to_string()))?;
    if descriptor_version != descriptor.version() {
        let here = descriptor.version();
        return Err(bad(
            1,
            &format!(
                "descriptor version {descriptor_version}, and this release computes {here}: make the table again"
            ),
        ));
    }

    // Levels, zone by zone.
    let mut csv = ReaderBuilder::new().from_reader(rows.as_bytes());
    let expected: Vec<String> =
        COLUMNS.map(str::to_owned).into_iter().chain(descriptor.number_names()).collect();
    if !csv.headers()?.iter().eq(expected.iter().map(String::as_str)) {
        return Err(bad(2, &format!("the columns should be {}", expected.join(","))));
    }
    let (mut zones, mut seen): (Vec<Zone>, HashSet<(String, u32)>) = (Vec::new(), HashSet::new());
    for record in csv.records() {
        let record = record?;
        let line = record.position().map_or(0, csv::Position::line) + 1;
        let (zone, level) = parse(&record).map_err(|what| bad(line, &what))?;
        match zones.last_mut() {
            Some(last) if last.scene == zone.scene && last.zone == zone.zone => {
                if last.levels.last().is_some_and(|l| l.spp > level.spp) {
                    return Err(bad(line, "levels of a zone must come by increasing spp"));
                }
                last.levels.push(level);
            }
            // A table that was pasted twice would weigh its zones twice
            _ if !seen.insert((zone.scene.clone(), zone.zone)) => {
                let what = format!("zone {} of {} has rows further above already", zone.zone, zone.scene);
                return Err(bad(line, &what));
            }
            _ => zones.push(Zone { levels: vec![level], ..zone }),
        }
    }
    if zones.is_empty() {
        return Err(bad(3, "the table has no zones"));
    }
    let numbers = descriptor.number_names();
    Ok(Table { descriptor, evidence, tone_mapping, viewing, numbers, zones, answers: Vec::new() })
}

fn parse(record: &StringRecord) -> Result<(Zone, Level), String> {
    let text = |i: usize| record.get(i).unwrap_or_default();
    let positive = |i: usize| match text(i).parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err(format!("{} is {:?}, not a positive number", COLUMNS[i], text(i))),
    };
    let finite = |i: usize| match text(i).parse::<f32>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("column {} is {:?}, not a finite number", i + 1, text(i))),
    };
    let origin = match text(9) {
        "real" => Origin::Real,
        "synthesised" => Origin::Synthesised,
        other => return Err(format!("origin is {other:?}, neither real nor synthesised")),
    };
    let descriptor = (COLUMNS.len()..record.len()).map(finite).collect::<Result<_, _>>()?;
    let level = Level { spp: positive(8)?, origin, noise: finite(10)?, descriptor };
    let zone = Zone {
        scene: text(0).to_owned(),
        group: text(1).to_owned(),
        zone: text(2).parse().map_err(|_| format!("zone is {:?}, not a number", text(2)))?,
        human_spp: positive(3)?,
        censored: text(4)
            .parse()
            .map_err(|_| format!("censored is {:?}, neither true nor false", text(4)))?,
        first_spp: positive(5)?,
        last_spp: positive(6)?,
        reference_spp: parse_reference(text(7))?,
        levels: Vec::new(),
    };
    if zone.reference_spp < zone.last_spp {
        return Err("reference_spp is below last_spp".into());
    }
    if zone.first_spp > zone.last_spp {
        return Err("first_spp is above last_spp".into());
    }
    Ok((zone, level))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::tests::zone;

    #[test]
    fn zones_that_are_listed_twice_are_refused_with_their_line() {
        let mut zones = vec![zone("A", 0, 100.0, 1.0), zone("B", 0, 100.0, 1.0), zone("A", 0, 100.0, 1.0)];
        zones.iter_mut().flat_map(|z| &mut z.levels).for_each(|l| l.descriptor = vec![0.0; 5]);
        let table = Table::new(Descriptor::default(), Evidence::Halves, zones);
        let read = |table: &Table| {
            let mut file = Vec::new();
            write_table(table, &mut file).unwrap();
            read_table(&file[..])
        };
        let error = read(&table).unwrap_err().to_string();
        // Two lines of head, and fourteen levels a zone
        assert!(error.contains("31") && error.contains("zone 0 of A has rows further above"), "{error}");
        let once = Table { zones: table.zones[..2].to_vec(), ..table };
        assert_eq!(read(&once).unwrap().zones.len(), 2);
    }
}
