//! Allocation and collection at large: limits, pacing, what goes back to the system, and structures of great
//! depth.

#![allow(unsafe_code, reason = "tests keep the promises that the heap asks of its owner")]

use esl_heap::heap::{
    AllocError, Heap, HeapConfig, HeapStats, Kind, Phase, RESERVE, SLICE_VISITS, SliceOutcome,
};
use esl_heap::value::Value;

fn heap(config: HeapConfig) -> Heap {
    // SAFETY: every test keeps the values of its heap.
    unsafe { Heap::new(config) }
}

fn collect(heap: &mut Heap, roots: &[Value]) {
    // SAFETY: the tests use nothing afterwards but what they give as roots.
    unsafe { heap.collect_fully(|heap| heap.mark_slice(roots)) };
    heap.check().unwrap();
}

/// Does the work of a VM at a tick, with `root` as the only root.
fn tick(heap: &mut Heap, root: Value) {
    if !heap.gc_due() {
        return;
    }
    if heap.phase() == Phase::Idle {
        heap.begin_cycle();
        heap.mark(root);
    } else if let SliceOutcome::Drained { .. } = heap.slice(SLICE_VISITS) {
        // SAFETY: `root` is all that the tests use afterwards.
        unsafe { heap.end_marking() };
    }
}

/// Smaller under Miri.
const fn scaled(n: usize) -> usize {
    if cfg!(miri) { n / 16 } else { n }
}

fn fill(heap: &mut Heap) -> (usize, AllocError) {
    let mut n = 0;
    loop {
        match heap.cons(Value::small(1), Value::NIL) {
            Ok(_) => n += 1,
            Err(e) => return (n, e),
        }
    }
}

#[test]
fn the_limit_asks_for_a_collection_which_makes_room() {
    let mut heap = heap(HeapConfig { limit: scaled(4 << 20), ..HeapConfig::default() });
    let (first, error) = fill(&mut heap);
    assert_eq!(error, AllocError::NeedCollection);
    // All but the metadata, a sixteenth, is used.
    assert_eq!(first * 16, scaled(4 << 20) / 16 * 15);
    collect(&mut heap, &[]);
    assert_eq!(heap.stats().live, 0);
    assert_eq!(fill(&mut heap), (first, AllocError::NeedCollection));
}

#[test]
fn the_reserve_opens_above_the_limit() {
    let mut heap = heap(HeapConfig { limit: scaled(4 << 20), ..HeapConfig::default() });
    let mut list = Value::NIL;
    while let Ok(more) = heap.cons(Value::NIL, list) {
        list = more;
    }
    collect(&mut heap, &[list]);
    assert_eq!(fill(&mut heap).0, 0);
    assert!(heap.open_reserve());
    assert!(!heap.open_reserve());
    assert_eq!(fill(&mut heap).0 * 16, RESERVE / 3 * 2 / 16 * 15, "an arena is two thirds of it");
    heap.close_reserve();
    collect(&mut heap, &[list]);
    assert_eq!(heap.stats().committed as usize, scaled(4 << 20), "what the reserve held went back");
    assert_eq!(fill(&mut heap).0, 0);
    assert!(heap.open_reserve());
}

#[test]
fn too_large_is_told_from_too_little_left() {
    let mut heap = heap(HeapConfig { limit: scaled(4 << 20), ..HeapConfig::default() });
    let half = scaled(2 << 20);
    let kept = heap.alloc_bytes_filled(half + 64, 0).unwrap();
    assert_eq!(heap.alloc_bytes_filled(half, 0), Err(AllocError::NeedCollection));
    let requested = scaled(4 << 20) + 16;
    let too_large = heap.alloc_bytes_filled(scaled(4 << 20), 0);
    assert_eq!(too_large, Err(AllocError::TooLarge { requested }));
    collect(&mut heap, &[kept]);
    assert_eq!(heap.alloc_bytes_filled(half, 0), Err(AllocError::NeedCollection));
    collect(&mut heap, &[]);
    assert!(heap.alloc_bytes_filled(half, 0).is_ok());
}

#[test]
fn holes_of_one_cons_are_used() {
    let mut heap = heap(HeapConfig { limit: scaled(1 << 20), ..HeapConfig::default() });
    let mut cells = Vec::new();
    while let Ok(cell) = heap.cons(Value::NIL, Value::NIL) {
        cells.push(cell);
    }
    // Every other one dies.
    let kept: Vec<Value> = cells.iter().copied().step_by(2).collect();
    collect(&mut heap, &kept);
    assert_eq!(fill(&mut heap).0, cells.len() - kept.len());
    for cell in kept {
        assert_eq!(heap.car(cell), Some(Value::NIL));
    }
}

#[test]
fn small_remainders_are_used_at_the_limit() {
    let mut heap = heap(HeapConfig { limit: scaled(1 << 20), ..HeapConfig::default() });
    let mut cells = Vec::new();
    while let Ok(cell) = heap.cons(Value::NIL, Value::NIL) {
        cells.push(cell);
    }
    // One of a hundred dies: less than the allocator looks at while it may grow.
    let kept: Vec<Value> =
        cells.iter().enumerate().filter(|(i, _)| i % 100 != 0).map(|(_, &cell)| cell).collect();
    collect(&mut heap, &kept);
    assert_eq!(fill(&mut heap).0, cells.len() - kept.len());
}

#[test]
fn medium_objects_do_not_waste_small_holes() {
    let mut heap = heap(HeapConfig::default());
    let bytes = if cfg!(miri) { 400 } else { 4000 };
    let before = heap.stats().committed;
    for _ in 0..100 {
        heap.alloc_bytes_filled(bytes, 0).unwrap();
        for _ in 0..100 {
            heap.cons(Value::NIL, Value::NIL).unwrap();
        }
    }
    let used = heap.stats().allocated;
    let committed = heap.stats().committed - before;
    assert!(committed <= used.next_multiple_of(scaled(1 << 20) as u64) + scaled(1 << 20) as u64);
}

#[test]
fn memory_goes_back_to_the_system() {
    let mut heap = heap(HeapConfig::default());
    let mut list = Value::NIL;
    for _ in 0..scaled(1_000_000) {
        list = heap.cons(Value::NIL, list).unwrap();
    }
    let vector = heap.alloc_vector_filled(scaled(1_000_000), list).unwrap();
    let full = heap.stats();
    assert!(full.committed as usize > scaled(24_000_000));
    collect(&mut heap, &[vector]);
    assert_eq!(heap.stats().committed, full.committed);
    collect(&mut heap, &[]);
    // The memory that will be filled before the next cycle stays, and an arena on either side of it.
    let kept = HeapConfig::default().cycle_floor + (2 << 20);
    assert!(heap.stats().committed as usize <= kept, "{:?}", heap.stats());
    assert_eq!(heap.stats().peak, full.peak);
}

#[test]
fn great_depth_needs_no_native_stack() {
    let deep = |heap: &mut Heap| {
        let n = if cfg!(miri) { 2000 } else { 1_000_000 };
        let (mut by_cdr, mut by_car, mut by_box, mut by_vector) =
            (Value::NIL, Value::NIL, Value::NIL, Value::NIL);
        for i in 0..n {
            by_cdr = heap.cons(Value::index(i), by_cdr).unwrap();
            by_car = heap.cons(by_car, Value::index(i)).unwrap();
        }
        for _ in 0..n / 4 {
            by_box = heap.alloc_box(by_box).unwrap();
            by_vector = heap.alloc_vector(&[by_vector, Value::NIL, Value::NIL]).unwrap();
        }
        // A list whose every element is a cons, from both ends: the mark stack overflows.
        let mut bushy = Value::NIL;
        for _ in 0..n {
            let leaf = heap.cons(Value::NIL, Value::NIL).unwrap();
            bushy = heap.cons(bushy, leaf).unwrap();
        }
        heap.alloc_vector(&[by_cdr, by_car, by_box, by_vector, bushy]).unwrap()
    };
    let work = move || {
        for mark_stack in [HeapConfig::default().mark_stack, 1000] {
            let mut heap = heap(HeapConfig { mark_stack, ..HeapConfig::default() });
            let root = deep(&mut heap);
            let live = heap.stats().allocated;
            collect(&mut heap, &[root]);
            assert_eq!(heap.stats().live, live);
            collect(&mut heap, &[root]);
            assert_eq!(heap.stats().live, live);
        }
    };
    std::thread::Builder::new().stack_size(128 << 10).spawn(work).unwrap().join().unwrap();
}

#[test]
fn slices_are_bounded_and_keep_up() {
    let floor = scaled(4 << 20);
    let mut heap = heap(HeapConfig { cycle_floor: floor, ..HeapConfig::default() });
    let n = scaled(100_000);
    let mut root = Value::NIL;
    for _ in 0..n {
        root = heap.cons(Value::NIL, root).unwrap();
        tick(&mut heap, root);
    }
    let vector = heap.alloc_vector_filled(n, root).unwrap();
    root = heap.cons(vector, root).unwrap();
    for _ in 0..20 * n {
        heap.cons(Value::NIL, Value::NIL).unwrap();
        tick(&mut heap, root);
    }
    let stats = heap.stats();
    let live = (n * 24) as u64;
    assert!(stats.cycles >= 3, "{stats:?}");
    if cfg!(miri) {
        // The pace is that of blocks of full size.
        return;
    }
    // A block or a piece of a vector may come on top.
    assert!(stats.longest_slice <= u64::from(SLICE_VISITS) + 512, "{stats:?}");
    assert!(stats.peak <= 2 * (live + floor as u64) + 2 * scaled(1 << 20) as u64, "{stats:?}");
}

#[test]
fn a_cycle_starts_when_as_much_was_allocated_as_lives() {
    let floor = 64 << 10;
    let mut heap = heap(HeapConfig { cycle_floor: floor, ..HeapConfig::default() });
    let allocate_until_due = |heap: &mut Heap| {
        let before = heap.stats().allocated;
        while !heap.gc_due() {
            heap.cons(Value::NIL, Value::NIL).unwrap();
        }
        (heap.stats().allocated - before) as usize
    };
    // Asked for at the granularity of a refill.
    let slack = 33 << 10;
    let first = allocate_until_due(&mut heap);
    assert!((floor - slack..floor + slack).contains(&first), "{first}");
    let live = 256 << 10;
    let root = heap.alloc_vector_filled(live / 8, Value::NIL).unwrap();
    collect(&mut heap, &[root]);
    let second = allocate_until_due(&mut heap);
    assert!((live - slack..live + slack).contains(&second), "{second}");
}

#[test]
fn what_is_allocated_at_once_is_owed_for() {
    let mut heap = heap(HeapConfig::default());
    let mut root = Value::NIL;
    for _ in 0..scaled(100_000) {
        root = heap.cons(Value::NIL, root).unwrap();
    }
    heap.begin_cycle();
    heap.mark(root);
    assert!(!heap.gc_due());
    heap.alloc_bytes_filled((10 * 16) << 10, 0).unwrap();
    let mut slices = 0;
    while heap.gc_due() {
        assert_eq!(heap.slice(10), SliceOutcome::More);
        slices += 1;
    }
    assert_eq!(slices, 10);
}

/// A run whose figures and identities depend on all that the heap decides.
fn run_of_a_program() -> (HeapStats, u64, Vec<u64>) {
    let mut heap = heap(HeapConfig { cycle_floor: 256 << 10, ..HeapConfig::default() });
    let root = heap.alloc_vector_filled(64, Value::NIL).unwrap();
    let mut seed = 1u64;
    for _ in 0..scaled(100_000) {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let len = (seed >> 58) as usize * if seed >> 33 & 127 == 0 { 30 } else { 1 };
        let v = heap.alloc_record_filled(Kind::Record, 0, len, root).unwrap();
        heap.vector_set(root, (seed >> 40) as usize % 64, v).unwrap();
        tick(&mut heap, root);
    }
    let identities = heap.vector(root).unwrap().iter().map(|&v| heap.identity(v)).collect();
    (heap.stats(), heap.cycle_id(), identities)
}

#[test]
fn runs_repeat_exactly() {
    let first = run_of_a_program();
    assert!(first.0.cycles > 2, "{first:?}");
    let (noise, second) = (vec![0u8; 12345], run_of_a_program());
    assert_eq!(first, second);
    drop(noise);
}

#[test]
fn identities_are_unique() {
    let mut heap = heap(HeapConfig::default());
    let mut all = vec![Value::NIL, Value::small(5), Value::T];
    for i in 0..scaled(100_000) {
        all.push(heap.cons(Value::NIL, Value::NIL).unwrap());
        if i % 1000 == 0 {
            all.push(heap.alloc_vector_filled(3000, Value::NIL).unwrap());
        }
    }
    let mut identities: Vec<u64> = all.iter().map(|&v| heap.identity(v)).collect();
    identities.sort_unstable();
    identities.dedup();
    assert_eq!(identities.len(), all.len());
}

#[test]
fn a_full_collection_drops_the_cycle_under_way() {
    let mut heap = heap(HeapConfig { mark_stack: 2, ..HeapConfig::default() });
    let mut list = Value::NIL;
    for _ in 0..scaled(10_000) {
        let leaf = heap.cons(Value::NIL, Value::NIL).unwrap();
        list = heap.cons(leaf, list).unwrap();
    }
    let before = heap.stats().allocated;
    heap.begin_cycle();
    heap.mark(list);
    assert_eq!(heap.slice(50), SliceOutcome::More);
    let young = heap.cons(Value::T, Value::NIL).unwrap();
    let garbage = heap.cons(Value::T, Value::NIL).unwrap();
    heap.set_cdr(garbage, list).unwrap();
    collect(&mut heap, &[list, young]);
    assert_eq!(heap.stats().live, before + 16, "neither the garbage nor what was marked early stays");
    assert_eq!(heap.phase(), Phase::Idle);
    collect(&mut heap, &[young]);
    assert_eq!(heap.stats().live, 16);
    assert_eq!(heap.car(young), Some(Value::T));
}

#[test]
#[should_panic(expected = "something is still to be followed")]
fn marking_does_not_end_early() {
    let mut heap = heap(HeapConfig::default());
    let cell = heap.cons(Value::NIL, Value::NIL).unwrap();
    heap.begin_cycle();
    heap.mark(cell);
    // SAFETY: it panics before anything is freed.
    unsafe { heap.end_marking() };
}

#[test]
fn the_collector_functions_do_nothing_out_of_turn() {
    let mut heap = heap(HeapConfig::default());
    let cell = heap.cons(Value::NIL, Value::NIL).unwrap();
    heap.mark(cell);
    assert_eq!(heap.slice(10), SliceOutcome::Finished);
    heap.begin_cycle();
    let cycle = heap.cycle_id();
    heap.begin_cycle();
    assert_eq!(heap.cycle_id(), cycle);
    heap.mark(cell);
    assert_eq!(heap.slice(10), SliceOutcome::Drained { left: 9 });
    // SAFETY: `cell` is all there is.
    unsafe { heap.end_marking() };
    assert_eq!(heap.phase(), Phase::Sweeping);
    heap.mark(cell);
    heap.begin_cycle();
    heap.mark(cell);
    assert_eq!((heap.phase(), heap.cycle_id()), (Phase::Marking, cycle + 1));
    collect(&mut heap, &[cell]);
    assert_eq!(heap.stats().live, 16);
}
