//! Write protection: seed and key.
//!
//! ```text
//!   key = first 8 bytes of HMAC-SHA256(secret, seed)
//! ```
//!
//! The secret stands in the configuration of the controller and in that of the client; on the bus there are only seed and key.
//! Seeds are made of the same function over a random start and a count, so that none comes twice. A wrong key ends the session,
//! and no seed is given out for [`PAUSE`] cycles. Without a secret nothing is ever unlocked.
//!
//! Source: RFC 2104 (HMAC), FIPS 180-4 (SHA-256), ASAM MCD-1 XCP 1.1, part 2, GET_SEED and UNLOCK.

use crate::packet::Refusal;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Bytes of a seed, and of a key.
pub(crate) const BYTES: usize = 8;
/// Bytes of seed or key in a packet.
pub(crate) const IN_PACKET: usize = 6;
/// Cycles after a wrong key in which no seed is given out.
pub(crate) const PAUSE: u64 = 1000;

/// The lock in front of all writing.
#[derive(Clone, Default)]
pub(crate) struct Lock {
    secret: Option<Vec<u8>>,
    start: [u8; 16],
    seeds: u64,
    open: bool,
    seed: [u8; BYTES],
    /// Bytes of the seed that were given out; `None` when there is none.
    given: Option<usize>,
    key: [u8; BYTES],
    had: usize,
    /// Cycles for which no seed is given out.
    pause: u64,
}

/// What became of a part of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turned {
    /// A part was taken; more of the key is to come.
    Halfway,
    Open,
    /// It was a wrong one: the session ends.
    Wrong,
}

impl Lock {
    /// A shut lock. `start` is random; in simulated time it is not, and seeds come again in the next run.
    pub(crate) fn new(secret: Option<Vec<u8>>, start: [u8; 16]) -> Self {
        Self { secret, start, ..Self::default() }
    }

    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    pub(crate) fn shut(&mut self) {
        (self.open, self.given, self.had) = (false, None, 0);
    }

    pub(crate) fn cycle(&mut self) {
        self.pause = self.pause.saturating_sub(1);
    }

    /// The seed, or what is left of it: how many bytes are, and up to [`IN_PACKET`] of them. None are when it is open.
    ///
    /// # Errors
    /// [`Refusal::AccessDenied`] without a secret and in the pause; [`Refusal::Sequence`] for a rest without a beginning.
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
                self.had = 0;
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

    /// Takes a key, or a part of it; `left` is how many of its bytes are still to come, these included.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] without a seed that was given out whole, and for a `left` that is not what is left.
    pub(crate) fn turn(&mut self, left: u8, part: &[u8]) -> Result<Turned, Refusal> {
        let Some(secret) = self.secret.as_ref().filter(|_| self.given == Some(BYTES)) else {
            return Err(Refusal::Sequence);
        };
        if usize::from(left) != BYTES - self.had {
            self.had = 0;
            return Err(Refusal::Sequence);
        }
        let count = part.len().min(usize::from(left));
        self.key[self.had..self.had + count].copy_from_slice(&part[..count]);
        self.had += count;
        if self.had < BYTES {
            return Ok(Turned::Halfway);
        }
        // Compared in a time that does not tell how much of it was right.
        self.open = mac(secret).chain_update(self.seed).verify_truncated_left(&self.key).is_ok();
        (self.given, self.had) = (None, 0);
        if self.open {
            return Ok(Turned::Open);
        }
        self.pause = PAUSE;
        Ok(Turned::Wrong)
    }
}

/// The key to a seed: the first bytes of its HMAC with the secret.
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

    fn turn(lock: &mut Lock, key: [u8; BYTES]) -> Turned {
        assert_eq!(lock.turn(8, &key[..6]), Ok(Turned::Halfway));
        lock.turn(2, &key[6..]).unwrap()
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
        assert_eq!(turn(&mut lock, key(seed)), Turned::Open);
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
            assert_eq!(turn(&mut lock, wrong), Turned::Wrong, "bit {bit}");
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
        assert_eq!(turn(&mut lock, key(first)), Turned::Open);
        lock.shut();
        assert_eq!(lock.turn(8, &key(first)[..6]), Err(Refusal::Sequence), "no seed, no key");
        assert_ne!(seed(&mut lock), first);
        assert_eq!(turn(&mut lock, key(first)), Turned::Wrong);
    }

    #[test]
    fn what_is_out_of_order_is_refused() {
        let mut lock = lock();
        assert_eq!(lock.seed(true), Err(Refusal::Sequence));
        assert_eq!(lock.turn(8, &[0; 6]), Err(Refusal::Sequence));
        let _ = lock.seed(false).unwrap();
        assert_eq!(lock.turn(8, &[0; 6]), Err(Refusal::Sequence), "half a seed");
        let _ = lock.seed(true).unwrap();
        assert_eq!(lock.turn(2, &[0; 2]), Err(Refusal::Sequence), "the end before the beginning");
        assert_eq!(Lock::new(None, [0; 16]).seed(false), Err(Refusal::AccessDenied));
    }
}
