//! Generates the reader's parser from its grammar.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=src/reader/grammar.lalrpop");
    let out = std::env::var("OUT_DIR")?;
    lalrpop::Configuration::new().set_in_dir("src/reader").set_out_dir(out).process()
}
