//! A stack of the grid taken four cells at a time, as controllers without vectors like it.

/// Evidence below this is as good as none: 3 % of full. As a mask of what is.
const FAINT: u32 = !0x0707_0707;

/// Whether no cell of a stack holds 8 or more.
#[inline]
pub(crate) fn is_faint<const E: usize>(stack: &[u8; E]) -> bool {
    let (fours, rest) = stack.as_chunks::<4>();
    let any = fours.iter().fold(0, |any, four| any | u32::from_ne_bytes(*four));
    any & FAINT == 0 && rest.iter().all(|cell| *cell < 8)
}

/// Whether a stack holds nothing.
#[inline]
pub(crate) fn is_empty<const E: usize>(stack: &[u8; E]) -> bool {
    let (fours, rest) = stack.as_chunks::<4>();
    fours.iter().fold(0, |any, four| any | u32::from_ne_bytes(*four)) == 0 && rest.iter().all(|cell| *cell == 0)
}

/// Raises every cell of `level` to at least the same cell of `by`.
#[inline]
pub(crate) fn raise<const E: usize>(level: &mut [u8; E], by: &[u8; E]) {
    let (fours, rest) = level.as_chunks_mut::<4>();
    let (by_fours, by_rest) = by.as_chunks::<4>();
    for (four, by) in fours.iter_mut().zip(by_fours) {
        // most of what is compared is empty, or full
        if u32::from_ne_bytes(*by) == 0 || *four == *by {
            continue;
        }
        if u32::from_ne_bytes(*four) == 0 {
            *four = *by;
            continue;
        }
        raise_cells(four, by);
    }
    raise_cells(rest, by_rest);
}

#[inline]
fn raise_cells(level: &mut [u8], by: &[u8]) {
    for (cell, by) in level.iter_mut().zip(by) {
        *cell = (*cell).max(*by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_raised_on_its_own_whatever_its_neighbours_hold() {
        let values = [0, 1, 127, 128, 200, 255];
        for a in values {
            for b in values {
                for at in 0..7 {
                    let (mut level, mut by) = ([9_u8; 7], [7_u8; 7]);
                    (level[at], by[at]) = (a, b);
                    let mut expected = [9; 7];
                    expected[at] = a.max(b);
                    raise(&mut level, &by);
                    assert_eq!(level, expected);
                    let (mut level, mut by) = ([0_u8; 7], [0_u8; 7]);
                    (level[at], by[at]) = (a, b);
                    raise(&mut level, &by);
                    assert_eq!(level[at], a.max(b));
                    assert_eq!(level.iter().filter(|v| **v > 0).count(), usize::from(a.max(b) > 0));
                }
            }
        }
    }

    #[test]
    fn eight_anywhere_is_not_faint() {
        assert!(is_faint(&[7; 9]));
        for at in 0..9 {
            let mut stack = [7; 9];
            stack[at] = 8;
            assert!(!is_faint(&stack));
        }
    }

    #[test]
    fn one_cell_anywhere_is_enough_not_to_be_empty() {
        assert!(is_empty(&[0; 9]));
        for at in 0..9 {
            let mut stack = [0; 9];
            stack[at] = 1;
            assert!(!is_empty(&stack));
        }
    }
}
