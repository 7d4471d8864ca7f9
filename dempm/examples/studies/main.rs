//! Numerical studies of a collapsing column, printed as tables.
//!
//!     cargo run --release -p dempm --example studies -- convergence scenes/column.toml
//!     cargo run --release -p dempm --example studies -- choices scenes/column.toml
mod choices;
mod convergence;
mod run;

use dempm::scene::Scene;
use miette::bail;

fn main() -> miette::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["convergence", scene] => convergence::study(&Scene::load(scene)?),
        ["choices", scene] => choices::study(&Scene::load(scene)?),
        _ => bail!("usage: studies convergence SCENE | choices SCENE"),
    }
}
