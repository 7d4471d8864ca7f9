//! Numerical studies whose tables are in `docs/notes/2026-11-22-columns.md`.
//!
//!     cargo run --release -p dempm --example studies -- convergence scenes/column.toml
//!     cargo run --release -p dempm --example studies -- choices scenes/column.toml
//!     cargo run --release -p dempm --example studies -- runout
mod choices;
mod convergence;
mod run;
mod runout;

use dempm::scene::Scene;
use miette::bail;

fn main() -> miette::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["convergence", scene] => convergence::study(&Scene::load(scene)?),
        ["choices", scene] => choices::study(&Scene::load(scene)?),
        ["runout"] => runout::study(),
        _ => bail!("usage: studies convergence SCENE | choices SCENE | runout"),
    }
}
