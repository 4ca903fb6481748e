//! At most 256 colours for a picture: a third of the bytes, and of the time to compress them.
//!
//! Median cut (Heckbert 1982): colours are counted in cells of 6 bits a channel; the box of cells with the largest
//! spread of pixels is cut at its median until there are 256; each box becomes its mean colour. The commonest colour,
//! the background, is kept as it is.

/// Colours in a palette.
const COLOURS: usize = 256;

/// Cells of the colour count.
const CELLS: usize = 1 << 18;

#[derive(Clone, Copy)]
struct Cell {
    key: u32,
    count: u32,
    sum: [u32; 3],
}

impl Cell {
    /// The cell's place along a channel, 0 to 63.
    fn at(&self, channel: usize) -> u32 {
        self.key >> (12 - 6 * channel) & 63
    }
}

/// Cells `from..to` of the list.
struct Block {
    from: usize,
    to: usize,
    /// Channel of the largest extent, and that extent times the number of pixels.
    channel: usize,
    spread: u64,
}

impl Block {
    fn new(cells: &[Cell], from: usize, to: usize) -> Self {
        let (mut channel, mut extent) = (0, 0);
        for k in 0..3 {
            let places = || cells[from..to].iter().map(|c| c.at(k));
            let size = places().max().unwrap_or(0) - places().min().unwrap_or(0);
            if size > extent {
                (channel, extent) = (k, size);
            }
        }
        let count: u64 = cells[from..to].iter().map(|c| u64::from(c.count)).sum();
        Self {
            from,
            to,
            channel,
            spread: count * u64::from(extent) * u64::from(extent),
        }
    }
}

fn key([r, g, b, _]: [u8; 4]) -> usize {
    usize::from(r >> 2) << 12 | usize::from(g >> 2) << 6 | usize::from(b >> 2)
}

/// The palette of a picture, and for each pixel its number there. Alpha is not looked at.
pub(super) fn indexed(pixels: &[[u8; 4]]) -> (Vec<[u8; 3]>, Vec<u8>) {
    let mut count = vec![0u32; CELLS];
    let mut sum = vec![[0u32; 3]; CELLS];
    for pixel in pixels {
        let cell = key(*pixel);
        count[cell] += 1;
        for k in 0..3 {
            // Relative to the cell, so that no picture is too large for 32 bits.
            sum[cell][k] += u32::from(pixel[k] & 3);
        }
    }
    let mut cells: Vec<Cell> = (0..CELLS)
        .filter(|&i| count[i] > 0)
        .map(|i| Cell {
            key: i as u32,
            count: count[i],
            sum: sum[i],
        })
        .collect();
    // The commonest first, out of the way of the cuts.
    if let Some(common) = (0..cells.len()).max_by_key(|&i| (cells[i].count, cells[i].key)) {
        cells.swap(0, common);
    }
    let mut blocks = vec![Block::new(&cells, 0, cells.len().min(1))];
    if cells.len() > 1 {
        blocks.push(Block::new(&cells, 1, cells.len()));
    }
    while blocks.len() < COLOURS {
        let Some(widest) = (0..blocks.len()).max_by_key(|&i| (blocks[i].spread, i)) else {
            break;
        };
        let Block {
            from,
            to,
            channel,
            spread,
        } = blocks[widest];
        if spread == 0 {
            break;
        }
        cells[from..to].sort_unstable_by_key(|c| (c.at(channel), c.key));
        let half: u64 = cells[from..to]
            .iter()
            .map(|c| u64::from(c.count))
            .sum::<u64>()
            / 2;
        let mut seen = 0;
        let mut cut = from + 1;
        for (i, cell) in cells[from..to - 1].iter().enumerate() {
            seen += u64::from(cell.count);
            cut = from + i + 1;
            if seen >= half {
                break;
            }
        }
        blocks[widest] = Block::new(&cells, from, cut);
        blocks.push(Block::new(&cells, cut, to));
    }
    let mut number = vec![0u8; CELLS];
    let palette = blocks
        .iter()
        .enumerate()
        .map(|(i, block)| {
            let (mut total, mut mean) = (0u64, [0u64; 3]);
            for cell in &cells[block.from..block.to] {
                number[cell.key as usize] = i as u8;
                total += u64::from(cell.count);
                for (k, m) in mean.iter_mut().enumerate() {
                    *m +=
                        u64::from(cell.sum[k]) + u64::from(cell.at(k) * 4) * u64::from(cell.count);
                }
            }
            mean.map(|m| ((m + total / 2) / total.max(1)) as u8)
        })
        .collect();
    (palette, pixels.iter().map(|p| number[key(*p)]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_kept_and_the_commonest_is_the_first() {
        let pixels = [[10, 20, 30, 255], [255; 4], [255; 4], [0, 0, 0, 255]];
        let (palette, numbers) = indexed(&pixels);
        assert_eq!(palette[0], [255; 3]);
        for (pixel, number) in pixels.iter().zip(numbers) {
            assert_eq!(palette[usize::from(number)], pixel[..3]);
        }
        assert!(indexed(&[]).1.is_empty());
    }

    #[test]
    fn many_colours_come_out_near() {
        let pixels: Vec<[u8; 4]> = (0..=255u8)
            .flat_map(|x| (0..=255u8).map(move |y| [x, x / 2 + y / 4, 255 - y / 2, 255]))
            .collect();
        let (palette, numbers) = indexed(&pixels);
        assert_eq!(palette.len(), 256);
        let mut error = 0.0;
        for (pixel, number) in pixels.iter().zip(numbers) {
            for k in 0..3 {
                error += f64::from(palette[usize::from(number)][k].abs_diff(pixel[k])).powi(2);
            }
        }
        let rms = (error / (3 * pixels.len()) as f64).sqrt();
        assert!(rms < 5.0, "{rms}");
    }
}
