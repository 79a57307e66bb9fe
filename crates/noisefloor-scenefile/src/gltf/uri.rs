//! Data and files that a URI names.

use crate::files::Folder;
use crate::{LoadError, Place};

/// Reads what `uri` names: the data in it, or a file in the folder of the scene. At most `limit` bytes.
pub(super) fn read(uri: &str, folder: &Folder, place: &Place, limit: u64) -> Result<Vec<u8>, LoadError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, data) =
            data.split_once(',').ok_or_else(|| place.bad("a data URI has a comma before its data"))?;
        if !kind.ends_with(";base64") {
            return Err(place.unsupported("a data URI that is not base64"));
        }
        place.at_most("bytes of data", data.len() as u64 / 4 * 3, limit)?;
        return base64(data.as_bytes()).ok_or_else(|| place.bad("its data URI is not base64"));
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

/// Decodes base64 (RFC 4648, §4), with or without its padding.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let end = text.iter().rposition(|c| *c != b'=').map_or(0, |last| last + 1);
    if text.len() - end > 2 || end % 4 == 1 {
        return None;
    }
    let mut bytes = Vec::with_capacity(end / 4 * 3 + 2);
    for group in text[..end].chunks(4) {
        let mut word = 0;
        for &c in group {
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            word = word << 6 | u32::from(digit);
        }
        let word = word << (6 * (4 - group.len()));
        bytes.extend(&word.to_be_bytes()[1..group.len()]);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded() {
        // RFC 4648, §10
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm8", "fo"), ("Zm9v", "foo"), ("Zm9vYmE=", "fooba")]
        {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes.as_bytes()), "{text}");
        }
        assert_eq!(base64(b"+/+/"), Some(vec![0xfb, 0xff, 0xbf]));
        for text in ["Z", "Zm9vY", "Zm 9", "Zm=v", "Zg==="] {
            assert_eq!(base64(text.as_bytes()), None, "{text}");
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
