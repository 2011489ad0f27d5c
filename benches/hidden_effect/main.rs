//! Hidden effects: data whose cause is known, and what `diagnose` says of them.
use phyture::critique::diagnose::{Options, diagnose};
use phyture::flight::Span;
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, Mechanism, Mechanisms, ROTOR_RADIUS_M, Simulation, simulate};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let seed: u64 = arguments.first().map_or(1, |a| a.parse().unwrap());
    let level = arguments.get(1).map_or("1", |a| a.as_str()).to_owned();
    let scales: Vec<f64> = arguments.get(2).map_or(vec![1.0], |a| a.split(',').map(|x| x.parse().unwrap()).collect());
    let names: Vec<String> = match arguments.get(3) {
        Some(list) => list.split(',').map(Into::into).collect(),
        None => std::iter::once("null".to_owned()).chain(Mechanism::ALL.iter().map(|m| m.id().to_owned())).collect(),
    };
    let verbose = arguments.get(4).is_some();
    for name in names {
        for &scale in &scales {
            let mut simulation = Simulation {
                seed,
                mechanisms: Mechanisms::none(),
                level: if level == "1" { Level::ONE } else { Level::TWO },
                ..Simulation::default()
            };
            for part in name.split('+').filter(|p| *p != "null") {
                simulation = simulation.hide(part, scale).unwrap();
            }
            let set = simulate(&simulation).unwrap();
            let model = Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
            let (mut searched, mut locked) = (Vec::new(), Vec::new());
            for (flight, log) in set.flights.iter().enumerate() {
                let span = Span { flight, start: 0, end: log.len() };
                if flight % 5 == 2 { locked.push(span) } else { searched.push(span) }
            }
            let outcome =
                diagnose(&set.flights, &model, &searched, &locked, "locked", &Options { seed, ..Options::default() }).unwrap();
            let d = outcome.diagnosis;
            let steps: Vec<String> = d
                .steps
                .iter()
                .map(|s| {
                    let fall = s.held_out_mse_fall.values().copied().fold(0.0, f64::max);
                    let parameters: Vec<String> =
                        s.parameters.iter().filter(|p| !p.fixed).map(|p| format!("{}={:.3}", p.name, p.value)).collect();
                    format!(
                        "{} {:.1}% p{:.4} f{:.2} {}{}",
                        s.effect,
                        100.0 * fall,
                        s.p_value,
                        s.selection_frequency,
                        parameters.join(","),
                        if s.indistinguishable.is_empty() { String::new() } else { format!(" ~{}", s.indistinguishable.join("/")) }
                    )
                })
                .collect();
            let locked_fall = d.locked.as_ref().map_or(0.0, |l| l.mse_fall.values().map(|v| v[0]).fold(0.0, f64::max));
            let hit = if name == "null" {
                if steps.is_empty() { "ok  " } else { "FALSE" }
            } else if d.accepted.first() == Some(&name) {
                "HIT "
            } else if d.accepted.is_empty() {
                "miss"
            } else {
                "WRONG"
            };
            println!(
                "{hit} L{level} {name} x{scale} seed {seed}: {} | locked {:.1}% | {:.1}s",
                steps.join("; "),
                100.0 * locked_fall,
                d.seconds
            );
            if verbose {
                println!("{d}");
            } else if let Some(own) = d.candidates.iter().find(|c| c.effect == name && steps.is_empty()) {
                println!("      own: {own:?}");
            }
        }
    }
}
