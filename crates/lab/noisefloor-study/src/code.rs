//! Participant codes: random, and carrying no other information.

use crate::error::StoreError;

/// Crockford's base 32: no I, L, O or U, so that codes survive being read aloud and written down.
const ALPHABET: &[u8; 32] = b"0123456789ABCDEFGHJKMNPQRSTVWXYZ";
/// 60 bits: a guess at a rate of one a second, against a thousand codes, succeeds once in 36 million years.
const LENGTH: usize = 12;

/// Draws a code from the operating system's random numbers.
pub(crate) fn draw() -> Result<String, StoreError> {
    let mut bytes = [0; LENGTH];
    getrandom::fill(&mut bytes).map_err(|_| StoreError::Closed)?;
    Ok(bytes.iter().map(|b| char::from(ALPHABET[usize::from(b % 32)])).collect())
}

/// Draws a seed for the order of trials from the operating system's random numbers.
pub(crate) fn draw_seed() -> Result<u64, StoreError> {
    let mut bytes = [0; 8];
    getrandom::fill(&mut bytes).map_err(|_| StoreError::Closed)?;
    Ok(u64::from_le_bytes(bytes))
}

/// Normalises a code as typed: drops spaces and hyphens, converts to capitals, and maps look-alike letters
/// to the alphabet. Returns `None` if the result cannot be a code.
pub fn parse(typed: &str) -> Option<String> {
    if typed.len() > 64 {
        return None;
    }
    let letter = |c: char| match c.to_ascii_uppercase() {
        'O' => '0',
        'I' | 'L' => '1',
        c => c,
    };
    let code: String = typed.chars().filter(|c| !matches!(c, '-' | ' ')).map(letter).collect();
    let known = |b: u8| ALPHABET.contains(&b);
    (code.len() == LENGTH && code.bytes().all(known)).then_some(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_survive_being_written_down() {
        let code = draw().unwrap();
        assert_eq!(parse(&code).as_deref(), Some(code.as_str()));
        assert_eq!(parse("o1l4-abcd efgh").as_deref(), Some("0114ABCDEFGH"));
        for bad in ["", "0114ABCDEFG", "0114ABCDEFGU", "0114ABCDEFGé", "../../etc/pas", &"A".repeat(100)] {
            assert_eq!(parse(bad), None, "{bad}");
        }
        assert_ne!(draw().unwrap(), code);
    }
}
