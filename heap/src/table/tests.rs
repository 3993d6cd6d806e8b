use super::*;
use proptest::prelude::*;
use std::collections::HashMap;

/// Model of a table: slots in order, the last one freed taken first.
#[derive(Default)]
struct Model {
    slots: Vec<Option<(i32, i32)>>,
    free: Vec<usize>,
    places: HashMap<i32, usize>,
}

impl Model {
    fn put(&mut self, key: i32, value: i32) {
        let place = *self.places.entry(key).or_insert_with(|| {
            self.free.pop().unwrap_or_else(|| {
                self.slots.push(None);
                self.slots.len() - 1
            })
        });
        self.slots[place] = Some((key, value));
    }

    fn remove(&mut self, key: i32) -> bool {
        match self.places.remove(&key) {
            Some(place) => {
                self.slots[place] = None;
                self.free.push(place);
                true
            }
            None => false,
        }
    }

    fn entries(&self) -> Vec<(i32, i32)> {
        self.slots.iter().flatten().copied().collect()
    }
}

fn new(heap: &mut Heap, test: KeyTest) -> Table {
    let v = Table::make(heap, KeyComparison::Native(test), 0, [Value::NIL; 2]).unwrap();
    Table::of(heap, v).unwrap()
}

fn find(heap: &Heap, table: Table, key: i32) -> Option<usize> {
    let key = Value::small(key);
    let hash = equality::hash(heap, KeyTest::Eql, key);
    table.find(heap, KeyTest::Eql, key, hash, &mut 4096).unwrap().map(|(entry, _)| entry)
}

fn put(heap: &mut Heap, table: Table, key: i32, value: i32) {
    match find(heap, table, key) {
        Some(entry) => table.set_value(heap, entry, Value::small(value)),
        None => {
            let hash = equality::hash(heap, KeyTest::Eql, Value::small(key));
            table.add(heap, hash, Value::small(key), Value::small(value)).unwrap();
        }
    }
}

fn entries(heap: &Heap, table: Table) -> Vec<(i32, i32)> {
    let small = |v: Value| v.as_fixnum().unwrap() as i32;
    let used = 0..table.used(heap);
    used.filter_map(|entry| table.entry(heap, entry)).map(|(k, v)| (small(k), small(v))).collect()
}

/// Miri is slow, and a program that it runs has no files to keep failures in.
fn config() -> ProptestConfig {
    match cfg!(miri) {
        true => ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() },
        false => ProptestConfig::default(),
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn agrees_with_the_model(
        range in prop_oneof![Just(4), Just(30), Just(500)],
        operations in prop::collection::vec((0u8..10, any::<u16>(), any::<i16>()), 0..800),
    ) {
        let mut heap = Heap::for_tests();
        let table = new(&mut heap, KeyTest::Eql);
        let mut model = Model::default();
        for (operation, key, value) in operations {
            let (key, value) = (i32::from(key) % range, i32::from(value));
            match operation {
                0..6 => {
                    put(&mut heap, table, key, value);
                    model.put(key, value);
                }
                6..9 => {
                    let found = find(&heap, table, key);
                    if let Some(entry) = found {
                        let hash = equality::hash(&heap, KeyTest::Eql, Value::small(key));
                        assert!(table.delete(&mut heap, entry, hash));
                    }
                    prop_assert_eq!(found.is_some(), model.remove(key));
                }
                _ if value % 16 == 0 => {
                    table.clear(&mut heap).unwrap();
                    model = Model::default();
                }
                _ => prop_assert_eq!(find(&heap, table, key).is_some(), model.places.contains_key(&key)),
            }
            prop_assert_eq!(table.count(&heap), model.places.len());
        }
        prop_assert_eq!(entries(&heap, table), model.entries());
        for key in model.places.keys() {
            prop_assert!(find(&heap, table, *key).is_some());
        }
    }
}

#[test]
fn a_large_table_keeps_everything() {
    let mut heap = Heap::for_tests();
    let table = new(&mut heap, KeyTest::Eql);
    let n = 3 * SEGMENT as i32 + 17;
    for key in 0..n {
        put(&mut heap, table, key * 7, key);
    }
    assert_eq!(table.count(&heap), n as usize);
    for key in 0..n {
        let entry = find(&heap, table, key * 7).unwrap();
        assert_eq!(table.entry(&heap, entry), Some((Value::small(key * 7), Value::small(key))));
        assert_eq!(find(&heap, table, key * 7 + 1), None);
    }
    for key in (0..n).step_by(2) {
        let entry = find(&heap, table, key * 7).unwrap();
        let hash = equality::hash(&heap, KeyTest::Eql, Value::small(key * 7));
        assert!(table.delete(&mut heap, entry, hash));
    }
    let expected: Vec<(i32, i32)> = (0..n).skip(1).step_by(2).map(|key| (key * 7, key)).collect();
    assert_eq!(entries(&heap, table), expected);
    for key in 0..n {
        put(&mut heap, table, -key - 1, key);
    }
    assert_eq!(table.count(&heap), expected.len() + n as usize);
    assert_eq!(
        find(&heap, table, 7).map(|entry| table.entry(&heap, entry).unwrap().1),
        Some(Value::small(1))
    );
}

#[test]
fn nobody_else_gets_hold_of_the_storage() {
    let mut heap = Heap::for_tests();
    let v = new(&mut heap, KeyTest::Eq).0;
    assert_eq!(heap.record(v, Kind::HashTable), None);
    assert_eq!((0..9).find_map(|index| heap.slot(v, index)), None);
    assert_eq!(heap.record_set(v, Kind::HashTable, 0, Value::NIL), None);
}

#[test]
fn keys_of_one_hash_are_candidates() {
    let mut heap = Heap::for_tests();
    let table = new(&mut heap, KeyTest::Eql);
    for key in 0..20 {
        table.add(&mut heap, 5 + 8 * (key as u32 % 2), Value::small(key), Value::NIL).unwrap();
    }
    let candidates = table.candidates(&heap, 5);
    let mut keys: Vec<i64> = candidates.iter().map(|(_, key)| key.as_fixnum().unwrap()).collect();
    keys.sort_unstable();
    assert_eq!(keys, (0..20).step_by(2).collect::<Vec<i64>>());
    assert!(candidates.iter().all(|&(entry, key)| table.entry(&heap, entry) == Some((key, Value::NIL))));
    assert_eq!(table.candidates(&heap, 6), []);
    let before = table.serial(&heap);
    table.set_value(&mut heap, 3, Value::T);
    assert_eq!(table.serial(&heap), before);
    assert!(!table.delete(&mut heap, 3, 6), "not in that chain");
    assert!(table.delete(&mut heap, 3, 13));
    assert_ne!(table.serial(&heap), before);
}
