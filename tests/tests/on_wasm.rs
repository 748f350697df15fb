//! A clip's frames are the same bits in WebAssembly, which is what a browser runs.

#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, mclip, require_target, vectors};
use wasmi::{Engine, Linker, Module, Store};

#[test]
fn frames_are_the_same_bits() {
    let target = "wasm32-unknown-unknown";
    if !require_target(target) {
        return;
    }
    let image = cargo::image("on-wasm", "on-wasm.wasm", target, "firmware", &[]);
    let engine = Engine::default();
    let module = Module::new(&engine, std::fs::read(image).unwrap()).unwrap();
    let mut store = Store::new(&engine, ());
    let instance = Linker::new(&engine).instantiate_and_start(&mut store, &module).unwrap();
    let memory = instance.get_memory(&store, "memory").unwrap();
    let address = |store: &mut Store<()>, name| {
        instance.get_typed_func::<(), u32>(&*store, name).unwrap().call(store, ()).unwrap() as usize
    };
    let (clip, hash) = (address(&mut store, "clip"), address(&mut store, "hash"));
    let decode = instance.get_typed_func::<(u32, u32), u32>(&store, "decode").unwrap();
    for case in vectors::with_trials() {
        for lend in [0, 1] {
            memory.write(&mut store, clip, &case.bytes).unwrap();
            let frames = decode.call(&mut store, (case.bytes.len() as u32, lend)).unwrap();
            assert!(frames > 0, "{}", case.name);
            let mut found = [0; 32];
            memory.read(&store, hash, &mut found).unwrap();
            let found: String = found.iter().map(|byte| format!("{byte:02x}")).collect();
            assert_eq!(found, case.sha256, "{}", case.name);
        }
    }
    assert_eq!(decode.call(&mut store, (3, 0)).unwrap(), 0, "three bytes are no clip");
    let decode = instance.get_typed_func::<u32, u32>(&store, "decode_mclip").unwrap();
    for case in mclip::with_sample() {
        memory.write(&mut store, clip, &case.bytes).unwrap();
        let frames = decode.call(&mut store, case.bytes.len() as u32).unwrap();
        assert!(frames > 0, "{}", case.name);
        let mut found = [0; 32];
        memory.read(&store, hash, &mut found).unwrap();
        let found: String = found.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(found, case.sha256, "{}", case.name);
    }
    assert_eq!(decode.call(&mut store, 3).unwrap(), 0, "three bytes are no clip");
}
