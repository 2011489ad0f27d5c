//! The last few results of a kind, by what they are of: a person looks at one state in several ways, and a page asks for several things at once.
//!
//! What is being made is waited for, not made a second time. Nothing here knows what is kept.

use super::held;
use crate::error::Result;
use std::sync::{Arc, Mutex};

/// Where one result is put; empty while it is made, and where that failed.
type Slot<V> = Arc<Mutex<Option<Arc<V>>>>;

/// Results by key, the oldest first.
pub(super) struct Recent<K, V> {
    slots: Mutex<Vec<(K, Slot<V>)>>,
    most: usize,
}

impl<K: PartialEq, V> Recent<K, V> {
    /// Keeps so many results.
    pub const fn new(most: usize) -> Self {
        Self { slots: Mutex::new(Vec::new()), most }
    }

    /// The result of a key, made where it is not known.
    ///
    /// # Errors
    /// Those of `make`; it is called again the next time.
    pub fn get(&self, key: K, make: impl FnOnce() -> Result<V>) -> Result<Arc<V>> {
        let slot = self.slot(key);
        let mut content = held(&slot);
        if let Some(known) = &*content {
            return Ok(Arc::clone(known));
        }
        let made = Arc::new(make()?);
        *content = Some(Arc::clone(&made));
        Ok(made)
    }

    fn slot(&self, key: K) -> Slot<V> {
        let mut slots = held(&self.slots);
        if let Some((_, slot)) = slots.iter().find(|(known, _)| *known == key) {
            return Arc::clone(slot);
        }
        if slots.len() >= self.most {
            slots.remove(0);
        }
        let slot = Slot::default();
        slots.push((key, Arc::clone(&slot)));
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_result_is_made_once_while_many_ask_and_forgotten_when_others_came() -> Result<()> {
        let (recent, made) = (Recent::new(2), AtomicUsize::new(0));
        let of = |key: u32| {
            recent.get(key, || {
                made.fetch_add(1, Ordering::SeqCst);
                std::thread::sleep(std::time::Duration::from_millis(20));
                Ok(10 * key)
            })
        };
        std::thread::scope(|scope| {
            let asked: Vec<_> = (0..4).map(|_| scope.spawn(|| of(1))).collect();
            let answered = asked.into_iter().filter_map(|asked| asked.join().ok()?.ok()).filter(|value| **value == 10).count();
            assert_eq!(answered, 4);
        });
        assert_eq!(made.load(Ordering::SeqCst), 1);
        assert_eq!([*of(2)?, *of(3)?, *of(1)?], [20, 30, 10]);
        assert_eq!(made.load(Ordering::SeqCst), 4, "the first was forgotten when the third came");
        Ok(())
    }

    #[test]
    fn what_failed_is_tried_again() -> Result<()> {
        let recent = Recent::new(1);
        let failed = recent.get((), || Err::<u8, _>(Error::Undetermined("not yet".into())));
        assert!(failed.is_err());
        assert_eq!(*recent.get((), || Ok(7))?, 7);
        Ok(())
    }
}
