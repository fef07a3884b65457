//! A landmark's model: where corners of its views are in space, and the surface between them.

use super::checksum::joined;
use super::{EncodeError, RecordFault};
use core::fmt;
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Points of one model, at most.
pub const POINTS_LIMIT: u16 = 4_096;

/// Triangles of one model, at most: a surface has at most twice as many as points.
pub const TRIANGLES_LIMIT: u16 = 2 * POINTS_LIMIT;

/// Bytes of a packed point: its corner 2, x, y and z 2 each.
pub const POINT_BYTES: usize = 8;

/// Bytes of a packed triangle: three numbers of points.
pub const TRIANGLE_BYTES: usize = 6;

/// Bytes of a modelled view: its number 2, how many of its corners have a place 2.
const GROUP_BYTES: usize = 4;

/// Bytes before the views of a model, at most: unit 5, scale 1 + 3, azimuth 1 + 3 + 3, deviation 3, three counts of 3.
const FIELDS_BYTES: usize = 28;

/// Bytes of a model's record, at least: seven fields of one byte, one view, three points.
pub(super) const MODEL_BYTES_LEAST: usize = 7 + GROUP_BYTES + 3 * POINT_BYTES;

/// Bytes of a model's record, at most.
pub(super) const MODEL_BYTES_MOST: u32 = (FIELDS_BYTES
    + POINTS_LIMIT as usize * GROUP_BYTES
    + POINTS_LIMIT as usize * POINT_BYTES
    + TRIANGLES_LIMIT as usize * TRIANGLE_BYTES) as u32;

/// A unit of a model's coordinates, at most, micrometres: 32,767 units are then 33 km.
pub const UNIT_LIMIT_UM: u32 = 1_000_000;

/// What applies to a whole model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ModelFacts {
    /// Coordinates count these, micrometres; 1 to [`UNIT_LIMIT_UM`]. Where the scale is not known, one metre stands for the
    /// unit of length of whoever made the model.
    pub unit_um: u32,
    /// Standard deviation of the scale in 1/10,000, at most 10,000; `None` if lengths mean nothing.
    pub scale_error: Option<u16>,
    /// Where the model's +y axis points, if that is known.
    pub azimuth: Option<StoredAzimuth>,
    /// Standard deviation of a point in the direction that is known worst, the median of all points, in units.
    pub deviation: u16,
}

/// An azimuth: from north, positive towards east.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StoredAzimuth {
    /// Hundredths of a degree, below 36,000.
    pub centidegrees: u16,
    /// Its standard deviation in hundredths of a degree, at most 18,000.
    pub deviation: u16,
}

/// A corner's place in the model, in units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PackedPoint {
    /// The number of the corner in its view.
    pub corner: u16,
    /// x, y, z.
    pub units: [i16; 3],
}

/// A view of which corners have places, for [`encode_model`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModelledView<'a> {
    /// Its number among the landmark's views, from 0.
    pub view: u16,
    /// The corners, by ascending number.
    pub points: &'a [PackedPoint],
}

/// A corner of a view with its place in the model frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelPoint {
    /// The number of the corner in its view.
    pub corner: u16,
    /// x, y, z in metres; see [`ModelFacts::scale_error`].
    pub position: [f64; 3],
}

/// A landmark's model, decoded where it is stored.
///
/// Model frame: right-handed, z up, +y into the building from its front, the origin at the landmark's position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredModel<'a> {
    facts: ModelFacts,
    groups: &'a [[u8; GROUP_BYTES]],
    points: &'a [[u8; POINT_BYTES]],
    triangles: &'a [[u8; TRIANGLE_BYTES]],
}

/// What a model's record cannot be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModelFault {
    /// The unit is zero or beyond [`UNIT_LIMIT_UM`].
    Unit {
        /// In micrometres.
        found: u32,
    },
    /// The scale's deviation is beyond the whole.
    ScaleError {
        /// In 1/10,000.
        found: u16,
    },
    /// The azimuth is a full turn or more, or its deviation more than half of one.
    Azimuth {
        /// In hundredths of a degree.
        centidegrees: u16,
        /// In hundredths of a degree.
        deviation: u16,
    },
    /// Fewer than three points, or more than [`POINTS_LIMIT`].
    PointCount {
        /// Points.
        found: usize,
    },
    /// More triangles than [`TRIANGLES_LIMIT`].
    TriangleCount {
        /// Triangles.
        found: usize,
    },
    /// A view that the landmark does not have, without a point, or not after the view before it.
    View {
        /// Its number among the landmark's views.
        found: u16,
    },
    /// The views' points are not as many as there are points.
    Points {
        /// Points of all views.
        found: usize,
        /// Points of the model.
        expected: usize,
    },
    /// A point's corner is beyond the table's limit, or not after the corner before it.
    Corner {
        /// The point.
        point: usize,
        /// Its corner.
        corner: u16,
    },
    /// A triangle with a point that is not there, or twice there, whose least point is not the first, or that does not sort
    /// after the triangle before it.
    Triangle {
        /// Its place among the triangles.
        index: usize,
    },
}

/// What precedes the views, as `postcard` writes it.
#[derive(Serialize, Deserialize)]
struct Fields {
    unit_um: u32,
    scale_error: Option<u16>,
    azimuth: Option<(u16, u16)>,
    deviation: u16,
    views: u16,
    points: u16,
    triangles: u16,
}

impl<'a> StoredModel<'a> {
    /// What applies to the whole model.
    pub const fn facts(&self) -> ModelFacts {
        self.facts
    }

    /// Metres a unit.
    fn unit(&self) -> f64 {
        f64::from(self.facts.unit_um) * 1e-6
    }

    /// Standard deviation of a point, metres: the median of all points.
    pub fn deviation_m(&self) -> f64 {
        f64::from(self.facts.deviation) * self.unit()
    }

    /// How many points it has.
    pub const fn len(&self) -> usize {
        self.points.len()
    }

    /// Never true for a model of a table: each has three points.
    pub const fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Point `index`.
    pub fn get(&self, index: usize) -> Option<ModelPoint> {
        self.points.get(index).map(|bytes| self.unpacked(bytes))
    }

    /// Point `index` as it is stored, in units.
    pub fn packed(&self, index: usize) -> Option<PackedPoint> {
        self.points.get(index).map(point_of)
    }

    /// All points: those of one view after those of another, by corner.
    pub fn points(&self) -> impl ExactSizeIterator<Item = ModelPoint> + Clone + use<'a> {
        let model = *self;
        self.points.iter().map(move |bytes| model.unpacked(bytes))
    }

    /// The views whose corners have places: the number among the landmark's views, and which points are its.
    pub fn views(&self) -> impl Iterator<Item = (u16, Range<usize>)> + Clone + use<'a> {
        let mut begin = 0_usize;
        self.groups.iter().map(move |group| {
            let (view, count) = group_of(group);
            let end = begin.saturating_add(usize::from(count));
            (view, core::mem::replace(&mut begin, end)..end)
        })
    }

    /// The surface: numbers of points, counter-clockwise seen from outside.
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = [u16; 3]> + Clone + use<'a> {
        self.triangles.iter().map(triangle_of)
    }

    fn unpacked(&self, bytes: &[u8; POINT_BYTES]) -> ModelPoint {
        let PackedPoint { corner, units } = point_of(bytes);
        ModelPoint { corner, position: units.map(|x| f64::from(x) * self.unit()) }
    }

    /// Decodes a record of a landmark with `views` views. With `trusted`, an earlier call has accepted the very same bytes.
    pub(super) fn decode(
        payload: &'a [u8],
        views: u32,
        corners_limit: u16,
        trusted: bool,
    ) -> Result<Self, RecordFault> {
        let (fields, rest) = postcard::take_from_bytes::<Fields>(payload).map_err(|_| RecordFault::Form)?;
        let fields_bytes = payload.len().saturating_sub(rest.len());
        let size = |count: u16, bytes: usize| usize::from(count).saturating_mul(bytes);
        let parts =
            [size(fields.views, GROUP_BYTES), size(fields.points, POINT_BYTES), size(fields.triangles, TRIANGLE_BYTES)];
        let expected = parts.iter().fold(fields_bytes, |sum, part| sum.saturating_add(*part));
        let wrong = RecordFault::Length { found: payload.len(), expected };
        if payload.len() != expected {
            return Err(wrong);
        }
        let [groups, points, _] = parts;
        let (groups, rest) = rest.split_at_checked(groups).ok_or(wrong)?;
        let (points, triangles) = rest.split_at_checked(points).ok_or(wrong)?;
        let facts = ModelFacts {
            unit_um: fields.unit_um,
            scale_error: fields.scale_error,
            azimuth: fields.azimuth.map(|(centidegrees, deviation)| StoredAzimuth { centidegrees, deviation }),
            deviation: fields.deviation,
        };
        let model = Self {
            facts,
            groups: groups.as_chunks().0,
            points: points.as_chunks().0,
            triangles: triangles.as_chunks().0,
        };
        if trusted {
            return Ok(model);
        }
        let mut canonical = [0; FIELDS_BYTES];
        let canonical = postcard::to_slice(&fields, &mut canonical).map_err(|_| RecordFault::NotCanonical)?;
        if !payload.starts_with(canonical) || canonical.len() != fields_bytes {
            return Err(RecordFault::NotCanonical);
        }
        model.check(views, corners_limit).map_err(RecordFault::Model)?;
        Ok(model)
    }

    fn check(&self, views: u32, corners_limit: u16) -> Result<(), ModelFault> {
        check_facts(&self.facts)?;
        check_counts(self.points.len(), self.triangles.len())?;
        let mut next = 0_u32;
        let mut points = 0_usize;
        for group in self.groups {
            let (found, count) = group_of(group);
            if u32::from(found) < next || u32::from(found) >= views || count == 0 {
                return Err(ModelFault::View { found });
            }
            next = u32::from(found).saturating_add(1);
            points = points.saturating_add(usize::from(count));
        }
        if points != self.points.len() {
            return Err(ModelFault::Points { found: points, expected: self.points.len() });
        }
        for (_, range) in self.views() {
            let mut next = 0_u16;
            for (point, bytes) in range.clone().zip(self.points.get(range).unwrap_or_default()) {
                let corner = point_of(bytes).corner;
                if corner < next || corner >= corners_limit {
                    return Err(ModelFault::Corner { point, corner });
                }
                next = corner.saturating_add(1);
            }
        }
        let mut before = None;
        for (index, bytes) in self.triangles.iter().enumerate() {
            let triangle = triangle_of(bytes);
            let [a, b, c] = triangle;
            let there = usize::from(b.max(c)) < self.points.len();
            if !there || a >= b || a >= c || b == c || before.is_some_and(|before| before >= triangle) {
                return Err(ModelFault::Triangle { index });
            }
            before = Some(triangle);
        }
        Ok(())
    }
}

/// Writes a model's record to the beginning of `buffer` and returns it.
///
/// `landmark_views` is how many views the landmark has, `corners_limit` the limit of the table. The views ascend, as do the
/// corners within a view. Points are numbered in that order; a triangle begins with its least number, and triangles ascend.
///
/// # Errors
///
/// A model that no reader would accept; a buffer that is too small.
pub fn encode_model<'b>(
    corners_limit: u16,
    landmark_views: u32,
    facts: &ModelFacts,
    views: &[ModelledView<'_>],
    triangles: &[[u16; 3]],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let points = views.iter().fold(0_usize, |sum, view| sum.saturating_add(view.points.len()));
    check_counts(points, triangles.len()).map_err(RecordFault::Model)?;
    if let Some(view) = views.get(usize::from(u16::MAX)..).unwrap_or_default().first() {
        return Err(RecordFault::Model(ModelFault::View { found: view.view }).into());
    }
    let fields = Fields {
        unit_um: facts.unit_um,
        scale_error: facts.scale_error,
        azimuth: facts.azimuth.map(|azimuth| (azimuth.centidegrees, azimuth.deviation)),
        deviation: facts.deviation,
        views: views.len() as u16,
        points: points as u16,
        triangles: triangles.len() as u16,
    };
    let mut scratch = [0; FIELDS_BYTES];
    let fields = postcard::to_slice(&fields, &mut scratch).map_err(|_| RecordFault::Form)?;
    let needed = fields
        .len()
        .saturating_add(views.len().saturating_mul(GROUP_BYTES))
        .saturating_add(points.saturating_mul(POINT_BYTES))
        .saturating_add(triangles.len().saturating_mul(TRIANGLE_BYTES));
    let available = buffer.len();
    let record = buffer.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, available })?;
    let groups = views
        .iter()
        .flat_map(|view| joined::<GROUP_BYTES>(&[&view.view.to_le_bytes(), &(view.points.len() as u16).to_le_bytes()]));
    let points = views.iter().flat_map(|view| view.points).flat_map(|point| {
        let [x, y, z] = point.units.map(i16::to_le_bytes);
        joined::<POINT_BYTES>(&[&point.corner.to_le_bytes(), &x, &y, &z])
    });
    let surface = triangles.iter().flat_map(|triangle| {
        let [a, b, c] = triangle.map(u16::to_le_bytes);
        joined::<TRIANGLE_BYTES>(&[&a, &b, &c])
    });
    let bytes = fields.iter().copied().chain(groups).chain(points).chain(surface);
    for (slot, byte) in record.iter_mut().zip(bytes) {
        *slot = byte;
    }
    // What is written is what a reader accepts.
    StoredModel::decode(record, landmark_views, corners_limit, false)?;
    Ok(record)
}

fn check_facts(facts: &ModelFacts) -> Result<(), ModelFault> {
    if !(1..=UNIT_LIMIT_UM).contains(&facts.unit_um) {
        return Err(ModelFault::Unit { found: facts.unit_um });
    }
    if let Some(found @ 10_001..) = facts.scale_error {
        return Err(ModelFault::ScaleError { found });
    }
    match facts.azimuth {
        Some(StoredAzimuth { centidegrees, deviation }) if centidegrees >= 36_000 || deviation > 18_000 => {
            Err(ModelFault::Azimuth { centidegrees, deviation })
        }
        _ => Ok(()),
    }
}

fn check_counts(points: usize, triangles: usize) -> Result<(), ModelFault> {
    if !(3..=usize::from(POINTS_LIMIT)).contains(&points) {
        return Err(ModelFault::PointCount { found: points });
    }
    if triangles > usize::from(TRIANGLES_LIMIT) {
        return Err(ModelFault::TriangleCount { found: triangles });
    }
    Ok(())
}

fn group_of(bytes: &[u8; GROUP_BYTES]) -> (u16, u16) {
    let [v0, v1, c0, c1] = *bytes;
    (u16::from_le_bytes([v0, v1]), u16::from_le_bytes([c0, c1]))
}

fn point_of(bytes: &[u8; POINT_BYTES]) -> PackedPoint {
    let [c0, c1, x0, x1, y0, y1, z0, z1] = *bytes;
    PackedPoint { corner: u16::from_le_bytes([c0, c1]), units: [[x0, x1], [y0, y1], [z0, z1]].map(i16::from_le_bytes) }
}

fn triangle_of(bytes: &[u8; TRIANGLE_BYTES]) -> [u16; 3] {
    let [a0, a1, b0, b1, c0, c1] = *bytes;
    [[a0, a1], [b0, b1], [c0, c1]].map(u16::from_le_bytes)
}

impl fmt::Display for ModelFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Unit { found } => write!(out, "its unit is {found} um, allowed are 1 to {UNIT_LIMIT_UM}"),
            Self::ScaleError { found } => {
                write!(out, "its scale is uncertain by {found}/10,000, allowed are 0 to 10,000")
            }
            Self::Azimuth { centidegrees, deviation } => write!(
                out,
                "its azimuth is {centidegrees} and uncertain by {deviation}, allowed are 0 to 35,999 and 0 to 18,000 (1/100 degree)"
            ),
            Self::PointCount { found } => write!(out, "it has {found} points, allowed are 3 to {POINTS_LIMIT}"),
            Self::TriangleCount { found } => {
                write!(out, "it has {found} triangles, allowed are 0 to {TRIANGLES_LIMIT}")
            }
            Self::View { found } => {
                write!(out, "view {found} is not one of the landmark's, without a point, or out of order")
            }
            Self::Points { found, expected } => write!(out, "its views have {found} points, it has {expected}"),
            Self::Corner { point, corner } => {
                write!(
                    out,
                    "point {point} belongs to corner {corner}, which is out of order or beyond the table's limit"
                )
            }
            Self::Triangle { index } => {
                write!(out, "triangle {index} names a point twice or one that is not there, or is out of order")
            }
        }
    }
}
