//! The board's 32 interrupts, of which no program uses any: everything is polled.

unsafe extern "C" {
    fn DefaultHandler();
}

/// The vector table's part after the core's exceptions.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [unsafe extern "C" fn(); 32] = [DefaultHandler; 32];
