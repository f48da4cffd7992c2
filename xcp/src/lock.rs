//! Write protection: seed and key.
//!
//! ```text
//!   key = first 8 bytes of HMAC-SHA256(secret, seed)
//! ```
//!
//! Controller and client know the secret from their configurations; the bus carries seed and key alone. Seeds are the same
//! function over a random start and a count, so that none is repeated. A wrong key ends the session, and no seed is issued for
//! [`PAUSE`] cycles. Without a secret the lock never opens.
//!
//! Source: RFC 2104 (HMAC), FIPS 180-4 (SHA-256), ASAM MCD-1 XCP 1.1, part 2, GET_SEED and UNLOCK.

use crate::packet::Refusal;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Bytes of a seed, and of a key.
pub(crate) const BYTES: usize = 8;
/// Bytes of seed or key in a packet.
pub(crate) const IN_PACKET: usize = 6;
/// Cycles after a wrong key in which no seed is issued.
pub(crate) const PAUSE: u64 = 1000;

/// Write protection of a slave.
#[derive(Clone, Default)]
pub(crate) struct Lock {
    secret: Option<Vec<u8>>,
    start: [u8; 16],
    seeds: u64,
    open: bool,
    seed: [u8; BYTES],
    /// Bytes of the seed that were issued; `None` without a seed.
    given: Option<usize>,
    key: [u8; BYTES],
    received: usize,
    /// Cycles for which no seed will be issued.
    pause: u64,
}

/// Result of a part of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyCheck {
    /// The key needs further parts.
    Incomplete,
    Open,
    /// The key is wrong; the session ends.
    Wrong,
}

impl Lock {
    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    /// A closed lock. `start` is random in real time; in simulated time it is constant, so that runs repeat.
    pub(crate) fn new(secret: Option<Vec<u8>>, start: [u8; 16]) -> Self {
        Self { secret, start, ..Self::default() }
    }

    pub(crate) fn shut(&mut self) {
        (self.open, self.given, self.received) = (false, None, 0);
    }

    pub(crate) fn cycle(&mut self) {
        self.pause = self.pause.saturating_sub(1);
    }

    /// Number of seed bytes that remain, and the next of them, [`IN_PACKET`] at most; 0 when the lock is open. `rest` continues a
    /// seed.
    ///
    /// # Errors
    /// [`Refusal::AccessDenied`] without a secret and in the pause; [`Refusal::Sequence`] for a rest without its first bytes.
    pub(crate) fn seed(&mut self, rest: bool) -> Result<(u8, [u8; IN_PACKET]), Refusal> {
        let Some(secret) = self.secret.as_ref().filter(|_| self.pause == 0) else {
            return Err(Refusal::AccessDenied);
        };
        if self.open {
            return Ok((0, [0; IN_PACKET]));
        }
        let from = match (rest, self.given) {
            (false, _) => {
                self.seeds += 1;
                let made = mac(secret).chain_update(self.start).chain_update(self.seeds.to_le_bytes());
                self.seed.copy_from_slice(&made.finalize().into_bytes()[..BYTES]);
                self.received = 0;
                0
            }
            (true, Some(given)) if given < BYTES => given,
            _ => return Err(Refusal::Sequence),
        };
        let count = (BYTES - from).min(IN_PACKET);
        let mut part = [0; IN_PACKET];
        part[..count].copy_from_slice(&self.seed[from..from + count]);
        self.given = Some(from + count);
        Ok(((BYTES - from) as u8, part))
    }

    /// Takes a key, or a part of it; `left` is the number of its bytes not yet received before this part.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] before the whole seed was issued, and for a wrong `left`.
    pub(crate) fn check_key(&mut self, left: u8, part: &[u8]) -> Result<KeyCheck, Refusal> {
        let Some(secret) = self.secret.as_ref().filter(|_| self.given == Some(BYTES)) else {
            return Err(Refusal::Sequence);
        };
        if usize::from(left) != BYTES - self.received {
            self.received = 0;
            return Err(Refusal::Sequence);
        }
        let count = part.len().min(usize::from(left));
        self.key[self.received..self.received + count].copy_from_slice(&part[..count]);
        self.received += count;
        if self.received < BYTES {
            return Ok(KeyCheck::Incomplete);
        }
        // Compared in constant time.
        self.open = mac(secret).chain_update(self.seed).verify_truncated_left(&self.key).is_ok();
        (self.given, self.received) = (None, 0);
        if self.open {
            return Ok(KeyCheck::Open);
        }
        self.pause = PAUSE;
        Ok(KeyCheck::Wrong)
    }
}

/// The key for a seed: the first 8 bytes of HMAC-SHA256 of `seed` under `secret`.
pub fn key(secret: &[u8], seed: [u8; BYTES]) -> [u8; BYTES] {
    let whole = mac(secret).chain_update(seed).finalize().into_bytes();
    std::array::from_fn(|byte| whole[byte])
}

fn mac(secret: &[u8]) -> Hmac<Sha256> {
    Hmac::new_from_slice(secret).unwrap_or_else(|_| unreachable!("HMAC takes a secret of any length"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &[u8] = b"a secret of sixteen or more bytes";

    fn lock() -> Lock {
        Lock::new(Some(SECRET.to_vec()), [7; 16])
    }

    fn seed(lock: &mut Lock) -> [u8; BYTES] {
        let (all, first) = lock.seed(false).unwrap();
        let (rest, second) = lock.seed(true).unwrap();
        assert_eq!((all, rest), (8, 2));
        let mut seed = [0; BYTES];
        seed[..6].copy_from_slice(&first);
        seed[6..].copy_from_slice(&second[..2]);
        seed
    }

    fn key(seed: [u8; BYTES]) -> [u8; BYTES] {
        super::key(SECRET, seed)
    }

    fn check_key(lock: &mut Lock, key: [u8; BYTES]) -> KeyCheck {
        assert_eq!(lock.check_key(8, &key[..6]), Ok(KeyCheck::Incomplete));
        lock.check_key(2, &key[6..]).unwrap()
    }

    /// RFC 4231, test case 2.
    #[test]
    fn the_function_is_hmac_sha256() {
        let made = mac(b"Jefe").chain_update(b"what do ya want for nothing?").finalize().into_bytes();
        assert_eq!(made[..8], [0x5b, 0xdc, 0xc1, 0x46, 0xbf, 0x60, 0x75, 0x4e]);
    }

    #[test]
    fn the_right_key_opens_until_it_is_shut() {
        let mut lock = lock();
        let seed = seed(&mut lock);
        assert_eq!(check_key(&mut lock, key(seed)), KeyCheck::Open);
        assert!(lock.is_open());
        assert_eq!(lock.seed(false).unwrap().0, 0, "no key is needed any more");
        lock.shut();
        assert!(!lock.is_open());
    }

    #[test]
    fn any_wrong_bit_is_a_wrong_key_and_costs_a_pause() {
        for bit in 0..64 {
            let mut lock = lock();
            let mut wrong = key(seed(&mut lock));
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(check_key(&mut lock, wrong), KeyCheck::Wrong, "bit {bit}");
            assert!(!lock.is_open());
            (1..PAUSE).for_each(|_| lock.cycle());
            assert_eq!(lock.seed(false), Err(Refusal::AccessDenied));
            lock.cycle();
            assert!(lock.seed(false).is_ok());
        }
    }

    #[test]
    fn a_key_serves_once() {
        let mut lock = lock();
        let first = seed(&mut lock);
        assert_eq!(check_key(&mut lock, key(first)), KeyCheck::Open);
        lock.shut();
        assert_eq!(lock.check_key(8, &key(first)[..6]), Err(Refusal::Sequence), "no seed, no key");
        assert_ne!(seed(&mut lock), first);
        assert_eq!(check_key(&mut lock, key(first)), KeyCheck::Wrong);
    }

    #[test]
    fn what_is_out_of_order_is_refused() {
        let mut lock = lock();
        assert_eq!(lock.seed(true), Err(Refusal::Sequence));
        assert_eq!(lock.check_key(8, &[0; 6]), Err(Refusal::Sequence));
        let _ = lock.seed(false).unwrap();
        assert_eq!(lock.check_key(8, &[0; 6]), Err(Refusal::Sequence), "half a seed");
        let _ = lock.seed(true).unwrap();
        assert_eq!(lock.check_key(2, &[0; 2]), Err(Refusal::Sequence), "the end before the beginning");
        assert_eq!(Lock::new(None, [0; 16]).seed(false), Err(Refusal::AccessDenied));
    }
}
