//! Data and files that a URI names.

use crate::files::Folder;
use crate::{LoadError, Place};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// Reads what `uri` names: the data in it, or a file in the folder of the scene. At most `limit` bytes.
pub(super) fn read(uri: &str, folder: &Folder, place: &Place, limit: u64) -> Result<Vec<u8>, LoadError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, data) =
            data.split_once(',').ok_or_else(|| place.bad("a data URI has a comma before its data"))?;
        if !kind.ends_with(";base64") {
            return Err(place.unsupported("a data URI that is not base64"));
        }
        place.at_most("bytes of data", data.len() as u64 / 4 * 3, limit)?;
        return BASE64.decode(data).map_err(|_| place.bad("its data URI is not base64"));
    }
    // A colon before any slash ends the name of a scheme
    if let Some((scheme, _)) = uri.split_once(':').filter(|(scheme, _)| !scheme.contains('/')) {
        return Err(place.unsupported(format_args!("a URI of the scheme {scheme:?}")));
    }
    let name = percent_decoded(uri).ok_or_else(|| place.bad(format_args!("{uri:?} is not a URI")))?;
    folder.read(&folder.find(&name, place)?, limit, place)
}

/// The text with every `%20` and the like replaced by what it stands for (RFC 3986, §2.1).
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        if byte == b'%' {
            let (digits, tail) = rest.split_first_chunk::<2>()?;
            let [high, low] = digits.map(|digit| (digit as char).to_digit(16));
            bytes.push((high? * 16 + low?) as u8);
            rest = tail;
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}

/// Base64 (RFC 4648, §4), with or without its padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_is_a_matter_of_taste() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zg=", "f"), ("Zm8", "fo"), ("Zm9", "fo"), ("Zm9v", "foo")]
        {
            assert_eq!(BASE64.decode(text).as_deref(), Ok(bytes.as_bytes()), "{text}");
        }
        for text in ["Z", "Zm9vY", "Zm 9", "Zm=v", "Zg==="] {
            assert!(BASE64.decode(text).is_err(), "{text}");
        }
    }

    #[test]
    fn escapes_are_decoded() {
        assert_eq!(percent_decoded("a%20b%C3%A9.bin").as_deref(), Some("a bé.bin"));
        for uri in ["%", "%2", "%g0", "%+1", "%ff"] {
            assert_eq!(percent_decoded(uri), None, "{uri}");
        }
    }
}
