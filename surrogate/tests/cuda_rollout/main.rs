//! Graphs, features, training batches and rollouts on a GPU against their CPU twins.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

mod features;
mod fixtures;
mod graphs;
mod rollouts;
mod scene;
mod stand_in;

use gpu::compile;
use surrogate::cuda::{
    Source, features_source, graph_source, integrate_source, push_forward_source,
};

use crate::stand_in::STAND_IN;

/// Needs NVRTC, but no GPU.
#[test]
fn kernels_compile() {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    for architecture in ["sm_80", "sm_90"] {
        for Source { name, text, defines } in [
            graph_source(),
            features_source(),
            integrate_source(),
            push_forward_source(),
            Source { name: "stand_in.cu", text: STAND_IN.to_owned(), defines: Vec::new() },
        ] {
            let cubin = compile(name, &text, architecture, &defines).unwrap();
            assert!(!cubin.is_empty(), "{name}");
        }
    }
}
