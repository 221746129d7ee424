//! The fault classes.

use crate::input::Bus;

/// What a bus, a sender or a receiver does to maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    Lossless,
    /// Frames are lost: 1, 5, 20 %; of a sender of visible ranges, too.
    Loss1,
    Loss5,
    Loss20,
    /// Every frame is up to 100 ms late.
    Reordered,
    /// Every frame is up to 50 ms late.
    Jitter,
    /// 1 % of the frames are up to 3 s late.
    Late1,
    /// 20 % of the frames come again, up to 3 s late.
    Repeated20,
    /// 5 % are up to 3 s late, 5 % come again up to 3 s late.
    LateAndRepeated,
    /// The receiver starts while 1 to 2.5 s of backlog drain.
    DrainAtStart,
    /// A gateway stands still for 2.6 to 3 s, then drains.
    DrainAfterStall,
    /// The cable is pulled and put back.
    Cuts,
    SenderRestarts,
    ReceiverRestarts,
    /// A second sender with the same number.
    TwoSenders,
    /// 2 % of the frames have a bit turned over, some are cut off.
    Flips,
    /// Intact frames of another epoch, one by one.
    Strays,
    /// The receiver's clock jumps, some of the times in a silence.
    ClockJumps,
    /// Mailboxes, a scan's frames at once, sent lowest identifier first.
    Mailboxes,
    /// 16 mailboxes that are kept full.
    MailboxesFull,
    /// For some seconds everything comes again, by a second path slower by 2.6 to 4.9 s.
    Echo,
    /// For up to 5 s everything is 0.15 to 4.9 s late.
    DelayPasses,
    /// From some moment on everything is 0.15 to 4.9 s late, and stays so.
    DelayStays,
    /// Messages of other sensors, of later versions, of installations, of other planes; visible ranges.
    Others,
    /// Headers that contradict, do not check, or are of another wire version.
    HeaderFaults,
    /// Made-up maps: noise, limits that change, azimuths without known cells; blocks that say edges of such.
    MadeUpMaps,
    /// A sender with a table of probabilities, and visible ranges; 5 % of its frames are lost.
    Probabilities,
    /// The same, and some of its azimuths are narrow.
    NarrowAzimuths,
    /// A second sender of the same number, epoch, header and clock, and of other maps: its words are of the same blocks
    /// and say something else.
    SynchronisedSenders,
}

use Class::{
    ClockJumps, Cuts, DelayPasses, DelayStays, DrainAfterStall, DrainAtStart, Echo, Flips, HeaderFaults, Jitter, Late1,
    LateAndRepeated, Loss1, Loss5, Loss20, Lossless, MadeUpMaps, Mailboxes, MailboxesFull, NarrowAzimuths, Others,
    Probabilities, ReceiverRestarts, Reordered, Repeated20, SenderRestarts, Strays, SynchronisedSenders, TwoSenders,
};

impl Class {
    pub const ALL: [Self; 29] = [
        Lossless,
        Loss1,
        Loss5,
        Loss20,
        Reordered,
        Jitter,
        Late1,
        Repeated20,
        LateAndRepeated,
        DrainAtStart,
        DrainAfterStall,
        Cuts,
        SenderRestarts,
        ReceiverRestarts,
        TwoSenders,
        Flips,
        Strays,
        ClockJumps,
        Mailboxes,
        MailboxesFull,
        Echo,
        DelayPasses,
        DelayStays,
        Others,
        HeaderFaults,
        MadeUpMaps,
        Probabilities,
        NarrowAzimuths,
        SynchronisedSenders,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Lossless => "lossless",
            Loss1 => "loss-1",
            Loss5 => "loss-5",
            Loss20 => "loss-20",
            Reordered => "reordered",
            Jitter => "jitter",
            Late1 => "late-1",
            Repeated20 => "repeated-20",
            LateAndRepeated => "late-and-repeated",
            DrainAtStart => "drain-at-start",
            DrainAfterStall => "drain-after-stall",
            Cuts => "cuts",
            SenderRestarts => "sender-restarts",
            ReceiverRestarts => "receiver-restarts",
            TwoSenders => "two-senders",
            Flips => "flips",
            Strays => "strays",
            ClockJumps => "clock-jumps",
            Mailboxes => "mailboxes",
            MailboxesFull => "mailboxes-full",
            Echo => "echo",
            DelayPasses => "delay-passes",
            DelayStays => "delay-stays",
            Others => "others",
            HeaderFaults => "header-faults",
            MadeUpMaps => "made-up-maps",
            Probabilities => "probabilities",
            NarrowAzimuths => "narrow-azimuths",
            SynchronisedSenders => "synchronised-senders",
        }
    }

    /// Share of the newest map's visible cells that is shown over 30 s from the start, in percent: at least this
    /// in the mean of many runs.
    pub fn least(self, bus: Bus) -> f64 {
        let [can, canfd, serial] = match self {
            Lossless | Others | Repeated20 | Strays | Echo => [97.5; 3],
            // the longest maps, 56 frames, nearly fill the time to the next at a millisecond a frame
            Mailboxes => [95.7, 97.5, 97.5],
            Loss1 | Late1 => [97.5, 98.0, 98.0],
            // visible ranges take their time on the bus, and narrow azimuths take more of it
            Loss5 | Probabilities => [93.5, 97.5, 97.5],
            NarrowAzimuths => [92.5, 97.5, 97.5],
            Loss20 => [66.0, 91.5, 91.5],
            Reordered => [60.0, 96.0, 95.3],
            Jitter | Flips => [96.7, 97.7, 97.7],
            LateAndRepeated => [94.0, 97.5, 97.5],
            // nothing is shown while a queue drains, nor before the next header
            DrainAtStart => [92.0, 91.5, 92.0],
            DrainAfterStall => [63.0, 61.0, 61.0],
            Cuts => [60.0; 3],
            SenderRestarts => [77.0, 76.0, 76.0],
            ReceiverRestarts => [84.2, 87.2, 87.0],
            TwoSenders => [65.0, 65.0, 63.0],
            // maps of one road are much alike
            SynchronisedSenders => [96.0, 96.5, 97.0],
            // a clock that jumps forward is no other than a delay, which is waited out for 5.12 s
            ClockJumps => [61.5, 60.0, 62.0],
            MailboxesFull => [92.2, 98.0, 98.0],
            DelayPasses => [86.0, 84.0, 78.0],
            DelayStays => [63.0, 61.0, 63.0],
            HeaderFaults => [70.0, 75.0, 75.0],
            MadeUpMaps => [87.3, 97.8, 97.4],
        };
        match bus {
            Bus::Can => can,
            Bus::CanFd => canfd,
            Bus::Serial => serial,
        }
    }

    /// How far below the mean of three runs may lie, points: where faults come by chance and last for seconds.
    pub fn spread(self) -> f64 {
        match self {
            Cuts | HeaderFaults => 30.0,
            ClockJumps | TwoSenders | DelayPasses | DelayStays => 15.0,
            DrainAtStart | DrainAfterStall | SenderRestarts | ReceiverRestarts | Reordered | Loss20 | MadeUpMaps => 6.0,
            SynchronisedSenders => 3.0,
            _ => 1.0,
        }
    }
}
