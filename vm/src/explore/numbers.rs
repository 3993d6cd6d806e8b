//! Numbers of objects, in the order in which a walk through a state meets them.

use crate::value::Value;

/// The numbers of the objects that a walk has met: a table by address.
pub(super) struct ObjectNumbers {
    /// Ordinal of the walk.
    walk: u32,
    /// Number of objects that it has met.
    count: usize,
    /// Places of objects, twice as many as objects at least; their number is a power of two.
    places: Vec<NumberedObject>,
}

/// An object that a walk has met.
#[derive(Clone, Copy)]
struct NumberedObject {
    object: Value,
    /// Ordinal of the walk that has met it; the place is free if that is another one.
    walk: u32,
    number: u32,
}

/// Number of places at first.
const PLACES: usize = 1 << 10;

impl NumberedObject {
    const FREE: NumberedObject = NumberedObject { object: Value::NIL, walk: 0, number: 0 };
}

impl Default for ObjectNumbers {
    fn default() -> ObjectNumbers {
        ObjectNumbers { walk: 0, count: 0, places: vec![NumberedObject::FREE; PLACES] }
    }
}

impl ObjectNumbers {
    /// Begins another walk.
    pub(super) fn begin(&mut self) {
        self.count = 0;
        self.walk = self.walk.wrapping_add(1);
        if self.walk == 0 {
            (self.places, self.walk) = (vec![NumberedObject::FREE; self.places.len()], 1);
        }
    }

    /// Returns the number of an object: `next`, if it is met for the first time.
    pub(super) fn of(&mut self, object: Value, next: u32) -> u32 {
        let last = self.places.len() - 1;
        // The upper bits of a product depend on all bits of an address.
        let mut at = (object.bits().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & last;
        while self.places[at].walk == self.walk {
            if self.places[at].object == object {
                return self.places[at].number;
            }
            at = (at + 1) & last;
        }
        self.places[at] = NumberedObject { object, walk: self.walk, number: next };
        self.count += 1;
        if 2 * self.count > self.places.len() {
            self.grow();
        }
        next
    }

    #[cold]
    fn grow(&mut self) {
        let places = vec![NumberedObject::FREE; 2 * self.places.len()];
        let old = std::mem::replace(&mut self.places, places);
        let walk = self.walk;
        self.count = 0;
        for NumberedObject { object, number, .. } in old.into_iter().filter(|place| place.walk == walk) {
            self.of(object, number);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_keeps_its_number_throughout_a_walk() {
        let mut numbers = ObjectNumbers::default();
        for walk in 0..3 {
            numbers.begin();
            let objects = |count: usize| (0..count).map(move |number| Value::index(number * (walk + 1)));
            for (object, next) in objects(3 * PLACES).zip(0..) {
                assert_eq!(numbers.of(object, next), next);
            }
            for (object, number) in objects(3 * PLACES).zip(0..) {
                assert_eq!(numbers.of(object, u32::MAX), number);
            }
        }
        numbers.walk = u32::MAX;
        numbers.begin();
        assert_eq!(numbers.of(Value::index(0), 9), 9);
    }
}
