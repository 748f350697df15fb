//! Bytes that were received and are not yet given out as packets.

/// At most `N` of them.
#[derive(Debug)]
pub(crate) struct ReceiveBuffer<const N: usize> {
    buffer: [u8; N],
    /// `start..end` of the buffer is received and not yet given out.
    start: usize,
    end: usize,
}

/// A packet that is given out: where it starts in the buffer, and its length.
pub(crate) type Span = (usize, usize);

impl<const N: usize> ReceiveBuffer<N> {
    pub(crate) const fn new() -> Self {
        Self { buffer: [0; N], start: 0, end: 0 }
    }

    pub(crate) const fn clear(&mut self) {
        (self.start, self.end) = (0, 0);
    }

    /// Moves what is pending to the front and appends what fits of `input`, whose front it takes.
    pub(crate) fn fill(&mut self, input: &mut &[u8]) {
        if input.is_empty() {
            return;
        }
        if self.start > 0 {
            if let Some(used) = self.buffer.get_mut(..self.end)
                && self.start <= used.len()
            {
                used.copy_within(self.start.., 0);
            }
            self.end = self.end.saturating_sub(self.start);
            self.start = 0;
        }
        let free = self.buffer.get_mut(self.end..).unwrap_or_default();
        let count = free.len().min(input.len());
        let (now, later) = input.split_at(count);
        for (slot, &byte) in free.iter_mut().zip(now) {
            *slot = byte;
        }
        self.end = self.end.saturating_add(count);
        *input = later;
    }

    /// What is pending.
    pub(crate) fn unread(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }

    /// Gives up so many of the bytes that are pending.
    pub(crate) const fn skip(&mut self, count: usize) {
        self.start = self.start.saturating_add(count);
    }

    /// Gives out so many of the bytes that are pending.
    pub(crate) const fn give_out(&mut self, len: usize) -> Span {
        let start = self.start;
        self.start = self.start.saturating_add(len);
        (start, len)
    }

    /// What was given out, until bytes are taken again.
    pub(crate) fn given(&mut self, (start, len): Span) -> &mut [u8] {
        self.buffer.get_mut(start..start.saturating_add(len)).unwrap_or_default()
    }
}
