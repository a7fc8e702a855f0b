//! Every input of every corpus is taken without a panic, and so are mutations of it.

use tests::fuzz::mutation::Mutator;
use tests::fuzz::{TARGETS, corpus};

/// The inputs of a target's corpus, by name.
fn inputs(target: &str) -> Vec<(String, Vec<u8>)> {
    let mut inputs: Vec<(String, Vec<u8>)> = std::fs::read_dir(corpus(target))
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            (name, std::fs::read(path).unwrap())
        })
        .collect();
    inputs.sort();
    inputs
}

#[test]
fn every_target_has_a_corpus_and_takes_it() {
    for target in TARGETS {
        let inputs = inputs(target.name);
        assert!(!inputs.is_empty(), "fuzz/corpus/{} is empty", target.name);
        for (_, input) in inputs {
            (target.run)(&input);
        }
        assert!(tests::repository().join(format!("fuzz/fuzz_targets/{}.rs", target.name)).exists());
    }
}

#[test]
fn every_target_takes_a_few_mutations_of_its_corpus() {
    for target in TARGETS {
        let corpus: Vec<Vec<u8>> =
            inputs(target.name).into_iter().map(|(_, input)| input).collect();
        for number in 0..20 {
            (target.run)(&Mutator::new(7, number).mutated(&corpus));
        }
    }
}
