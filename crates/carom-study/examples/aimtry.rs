use carom_study::aim::Problem;
fn main() {
    let file = std::env::args().nth(1).unwrap();
    let t = std::time::Instant::now();
    let problem = Problem::from_file(file).unwrap_or_else(|e| panic!("{e}"));
    println!("read {:?}", t.elapsed());
    let t = std::time::Instant::now();
    match problem.solve() {
        Err(e) => println!("{e}"),
        Ok(f) => {
            for s in &f.steps {
                println!("{:.3e} cost {:.10} step {:.3e} {:?}", s.miss, s.cost, s.change, s.events);
            }
            for u in f.unknowns.iter().take(20) {
                println!("{} {} -> {} {}", u.name, u.first, u.found, u.at_bound);
            }
            for u in &f.conditions {
                println!("{} {} {:.2e}", u.name, u.value, u.miss);
            }
            println!("{:?} cost {:.12} runs {} diff {} {:?}", f.end, f.cost, f.runs, f.differentiated, t.elapsed());
        }
    }
}
