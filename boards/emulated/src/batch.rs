//! Batch mode: the estimator over every scan of a job file, a fingerprint of each map and its messages, and
//! what it cost where the core counts instructions.

/// Makes the program `batch`, with its memory, for a size of unit, what its scans hold, and a core.
#[macro_export]
macro_rules! batch {
    ($board:ident, $core:expr) => {
        $crate::batch!([$board::profile], $board::SHAPE, $crate::viewshed::Detection, $core);
    };
    ([$($profile:ident)::+], $shape:expr, $entry:ty, $core:expr) => {
        use $($profile)::+::{Map, Parameters, Sender, State};
        use $crate::semihost::HostFile;
        use $crate::semihosting::process::exit;
        use $crate::static_cell::{ConstStaticCell, StaticCell};
        use $crate::viewshed::bench::files::Files;
        use $crate::viewshed::bench::job::{Job, ScanBuffer};
        use $crate::viewshed::bench::{run, start};
        use $crate::viewshed::fixed::time::Time;
        use $crate::viewshed::unit::Unit;
        use $crate::viewshed::wire::broadcast::Medium;
        use $crate::viewshed::wire::message::Epoch;

        /// Detections or boxes of a recorded scan, before the gate.
        const MOST_DETECTIONS: usize = 16_384;

        static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
        static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
        static PARAMETERS: StaticCell<Option<Parameters>> = StaticCell::new();
        static SENDER: StaticCell<Option<Sender>> = StaticCell::new();
        #[unsafe(link_section = ".bench")]
        static SCAN: ConstStaticCell<ScanBuffer<MOST_DETECTIONS, $entry>> = ConstStaticCell::new(ScanBuffer::new());

        fn batch() -> ! {
            let Some(mut files) = Files::<HostFile, _>::open($core) else { exit(2) };
            let Ok(job) = Job::read(&mut files) else { exit(1) };
            let (Some(state), Some(map), Some(scan)) = (STATE.try_take(), MAP.try_take(), SCAN.try_take()) else {
                exit(4)
            };
            let (Some(parameters), Some(sender)) = (PARAMETERS.try_init(None), SENDER.try_init(None)) else { exit(4) };
            let settings = Some(&job.settings);
            start::<State, _>(parameters, sender, settings, Medium::Serial, Epoch::new(0), Time::from_micros(0));
            let (Some(parameters), Some(sender)) = (parameters, sender) else { exit(1) };
            let mut unit = Unit::new(parameters, state, map, sender);
            exit(if run(&mut files, &job, $shape, &mut unit, scan).is_ok() { 0 } else { 1 })
        }
    };
}
