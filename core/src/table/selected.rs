//! Some of a table's views, as if there were no others: those near a known place, or of one kind.

use super::{Header, Landmark, StoredModel, StoredView, TableError, ViewSource};

/// A source that shows only some views of another one.
///
/// A search among fewer views is faster, and an answer less often false: the probability counts the views that were compared.
/// Views are numbered by their place in the selection; [`Recognition::renumbered`](crate::verdict::Recognition::renumbered)
/// takes an answer back to the numbers of the table. Landmarks keep theirs.
#[derive(Debug)]
pub struct SelectedViews<'v, S> {
    source: S,
    views: &'v [u32],
}

impl<'v, S: ViewSource> SelectedViews<'v, S> {
    /// Of `source` the views with these numbers, ascending.
    pub const fn new(source: S, views: &'v [u32]) -> Self {
        Self { source, views }
    }
}

impl<S: ViewSource> ViewSource for SelectedViews<'_, S>
where
    S::Error: From<TableError>,
{
    type Error = S::Error;

    fn header(&self) -> &Header {
        self.source.header()
    }

    fn buffer_bytes(&self) -> usize {
        self.source.buffer_bytes()
    }

    fn view<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<StoredView<'s>, Self::Error> {
        let (kind, count) = (super::RecordKind::View, self.views.len() as u32);
        let number = *self.views.get(number as usize).ok_or(TableError::NoSuchRecord { kind, number, count })?;
        self.source.view(number, buffer)
    }

    fn landmark<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Landmark<'s>, Self::Error> {
        self.source.landmark(number, buffer)
    }

    fn model_bytes(&self) -> usize {
        self.source.model_bytes()
    }

    fn model<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Option<StoredModel<'s>>, Self::Error> {
        self.source.model(number, buffer)
    }

    fn view_count(&self) -> u32 {
        self.views.len() as u32
    }
}
