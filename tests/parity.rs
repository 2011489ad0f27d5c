//! Agreement with another program's Phy-Ture: outputs, loss, every gradient, one Adam step. Needs the exported files; says so
//! and passes where they are absent.
#![cfg(feature = "disk")]

use phyture::Result;
use phyture::nn::parity;
use phyture::tape::Threads;
use std::path::Path;

/// Largest relative error of any tensor that an f32 file may show: sums of up to some thousand products in another order.
const F32_BOUND: f64 = 1e-4;
/// The same for f64.
const F64_BOUND: f64 = 1e-9;

#[test]
fn every_tensor_of_the_exported_files_is_met() -> Result<()> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/parity"));
    for (name, precision, bound) in [
        ("small_f64.safetensors", "f64", F64_BOUND),
        ("variant_f64.safetensors", "f64", F64_BOUND),
        ("small_f32.safetensors", "f32", F32_BOUND),
    ] {
        let path = folder.join(name);
        if !path.exists() {
            eprintln!("skipped: no {name} beside this checkout");
            continue;
        }
        let found = parity::compare(&path, Threads(2))?;
        eprintln!("{name}: worst {:?} of {} tensors", found.worst, found.relative_error.len());
        assert_eq!(found.precision, precision);
        let off: Vec<_> = found.relative_error.iter().filter(|(_, error)| **error > bound).collect();
        assert!(off.is_empty(), "{name}: {off:?}");
        for prefix in ["output", "loss", "grad.input.state", "grad.input.physics", "grad.param.", "adam1.param."] {
            assert!(found.relative_error.keys().any(|tensor| tensor.starts_with(prefix)), "{name}: no {prefix} compared");
        }
    }
    Ok(())
}
