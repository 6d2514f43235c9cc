//! Data that a model reads from files at instantiation: shared by clones, and not part of a saved state.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::any::Any;
use std::cell::RefCell;
use std::mem::{ManuallyDrop, take};
use std::ops::Deref;
use std::sync::Arc;

/// Data that a model reads in [`load`](crate::Model::load). A clone shares it; a saved state does not contain it, and the
/// exporter restores it when a state is read from bytes. Before `load`, it is the default of its type.
///
/// A resource may be any field of the model, except inside a list whose length changes.
///
/// ```
/// # use fmu_core::Resource;
/// let map = Resource::from(vec![1.0, 2.0]);
/// assert_eq!(map[1], 2.0);
/// ```
#[derive(Debug, Default)]
pub struct Resource<T>(Arc<T>);

impl<T> Clone for Resource<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> From<T> for Resource<T> {
    fn from(data: T) -> Self {
        Self(Arc::new(data))
    }
}

impl<T> Deref for Resource<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

/// Nothing is written.
impl<T: Send + Sync + 'static> Serialize for Resource<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SHELF.with_borrow_mut(|shelf| {
            if shelf.collects {
                shelf.data.push(self.0.clone());
            }
        });
        serializer.serialize_unit()
    }
}

/// The next resource of the [`Shelf`] in use; without one, the default.
impl<'de, T: Default + Send + Sync + 'static> Deserialize<'de> for Resource<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <()>::deserialize(deserializer)?;
        let next = SHELF.with_borrow_mut(|shelf| {
            shelf.next += 1;
            shelf.data.get(shelf.next - 1).cloned()
        });
        Ok(next.and_then(|data| data.downcast().ok()).map_or_else(Self::default, Self))
    }
}

/// The resources of an instance, in the order in which its model is serialized.
#[derive(Clone, Default)]
pub struct Shelf(Vec<Arc<dyn Any + Send + Sync>>);

impl Shelf {
    /// Collects the resources of everything that is serialized during the call.
    pub fn of(serialize: impl FnOnce()) -> Self {
        let _cleared = InUse::start(Vec::new(), true);
        serialize();
        SHELF.with_borrow_mut(|shelf| Self(take(&mut *shelf.data)))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Restores the resources in everything that is deserialized during the call.
    pub fn attach<T>(&self, deserialize: impl FnOnce() -> T) -> T {
        if self.is_empty() {
            return deserialize();
        }
        let _cleared = InUse::start(self.0.clone(), false);
        deserialize()
    }
}

/// serde passes no context along, so the shelf in use is a variable of the thread.
struct Used {
    /// Empty unless a shelf is in use. A thread variable with a destructor would prevent the binary from being unloaded.
    data: ManuallyDrop<Vec<Arc<dyn Any + Send + Sync>>>,
    next: usize,
    collects: bool,
}

thread_local! {
    static SHELF: RefCell<Used> =
        const { RefCell::new(Used { data: ManuallyDrop::new(Vec::new()), next: 0, collects: false }) };
}

/// Empties the thread's shelf at its end, even after a panic.
struct InUse;

impl InUse {
    fn start(data: Vec<Arc<dyn Any + Send + Sync>>, collects: bool) -> Self {
        SHELF.set(Used { data: ManuallyDrop::new(data), next: 0, collects });
        Self
    }
}

impl Drop for InUse {
    fn drop(&mut self) {
        let Used { mut data, .. } =
            SHELF.replace(Used { data: ManuallyDrop::new(Vec::new()), next: 0, collects: false });
        drop(take(&mut *data));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Pair = (Resource<Vec<u8>>, Resource<String>);

    fn stored(pair: &Pair) -> String {
        serde_json::to_string(pair).unwrap()
    }

    fn read(text: &str) -> Pair {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn clones_share_what_was_read() {
        let map = Resource::from(vec![1, 2]);
        assert!(std::ptr::eq(map.as_slice(), map.clone().as_slice()));
    }

    /// The bytes contain nothing of it; a shelf gives it back, in order and by type.
    #[test]
    fn a_shelf_restores_what_is_not_stored() {
        let pair: Pair = (vec![1, 2].into(), "map".to_owned().into());
        let (mut text, mut other) = (String::new(), String::new());
        let shelf = Shelf::of(|| text = stored(&pair));
        assert_eq!(text, "[null,null]");
        let alone = read(&text);
        assert!(alone.0.is_empty() && alone.1.is_empty(), "without a shelf, the defaults");
        let again = shelf.attach(|| read(&text));
        assert!(std::ptr::eq(again.0.as_slice(), pair.0.as_slice()) && *again.1 == "map");
        // After its use, the thread has no shelf: neither one that collects nor one that gives.
        assert!(Shelf::of(|| ()).is_empty() && read(&text).0.is_empty());
        assert!(!shelf.is_empty() && shelf.attach(|| read(&text)).1.len() == 3, "a second time");
        let swapped: (Resource<String>, Resource<Vec<u8>>) = shelf.attach(|| serde_json::from_str(&text).unwrap());
        assert!(swapped.0.is_empty() && swapped.1.is_empty(), "another type");
        let empty = Shelf::of(|| other.push('x'));
        assert!(empty.is_empty() && empty.attach(|| read(&text)).0.is_empty());
    }

    #[test]
    fn a_panic_leaves_no_shelf_behind() {
        let pair: Pair = (vec![1, 2].into(), "map".to_owned().into());
        let shelf = Shelf::of(|| drop(stored(&pair)));
        let failed =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| shelf.attach(|| panic!("in the middle"))));
        assert!(failed.is_err() && read("[null,null]").0.is_empty());
    }
}
