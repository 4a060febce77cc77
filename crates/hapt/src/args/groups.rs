//! The first page of the help: the commands by task.

/// The template of `hapt --help`. A test compares its lines with the commands' own.
pub const TEMPLATE: &str = "\
{about-with-newline}
{usage-heading} {usage}

Try it:
  worlds          List the built-in worlds, each with its verdict
  init            Write a commented world file to start from, and its schema for editors
  design          Compute stiffness, inertia and compensating damping from a specification, as a
                  world file
  live            Run the loop in real time behind a page with the wheel and its numbers
  sim             Run the scenarios of a world on an exact simulation of device and hand

Certify:
  check           Certify a world: stability held and hands-off, passivity, and remedies
  worst           Search for the passive hand that extracts most energy from the loop
  boundary        Trace the exact edges of stability and passivity in the plane of two keys
  impedance       Compute the rendered impedance against frequency, or the Z-width of a device
  sweep           Measure every combination of a few numbers of a world, as a table and a picture

On hardware:
  devices         List serial ports and CAN interfaces, and the drives that may be behind them
  identify        Identify a device from a log or an experiment: inertia, friction, lag, delay
  run             Run a world in real time on a device, and remove the torque at the end
  wheel           Show the device to this computer as a force-feedback wheel for games (Linux)
  flash           Certify a world, send it to a board with hapt's firmware, and verify it there
  latency         Measure how well this machine keeps a loop's time
  simulate-drive  Simulate a motor drive and its wheel on a serial port or a CAN bus

Draw and share:
  plot            Draw position, velocity and torque over time, from a run's CSV or from a log
  report          Write a page a world: diagram, verdict, eigenvalues, motion, torque and energy
                  over time
  export          Export a world for the simulators and the boards of others
  log             Replay a log through the present core, or convert it to CSV or Parquet

Reference:
  explain         Explain a term of a message or a verdict; print the schema, manual, completions,
                  licences
  help            Print this message or the help of the given subcommand(s)

Options:
{options}{after-help}";

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use crate::args::Args;

    #[test]
    fn every_command_stands_in_one_group_with_its_own_words() {
        let mut command = Args::command();
        command.build();
        let page = super::TEMPLATE.split_once("Try it:").unwrap().1;
        let page = format!(" {} ", page.split_whitespace().collect::<Vec<_>>().join(" "));
        let mut listed = 0;
        for command in command.get_subcommands().filter(|command| !command.is_hide_set()) {
            let line = format!(" {} {} ", command.get_name(), command.get_about().unwrap());
            assert_eq!(page.matches(&line).count(), 1, "{line}");
            listed += 1;
        }
        let lines = super::TEMPLATE.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
        assert_eq!(lines.count(), listed);
    }
}
