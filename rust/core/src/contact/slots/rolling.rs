//! Contacts of thin discs and tori with the faces of a surface, all lanes at once:
//! [`super::pieces`].

use super::contacts::{ContactSlots, DetectionInput};
use super::ground::BlockGround;
use super::pieces::{LaneDisc, LanePlane};
use crate::geometry::query::disc_plane::{rolling, to_lowest};
use crate::scalar::{Lane, LaneMask, Vec3};

impl<T: Lane> ContactSlots<T> {
    /// Adds the contacts of a wheel with faces at the midpoint, in some lanes; it has the axle `s`
    /// and the centre `centre` there. Returns the lanes where they must be found lane by lane.
    #[inline(always)]
    pub(crate) fn look_at_pieces(
        &mut self,
        (w, lanes): (usize, T::Mask),
        ground: &mut BlockGround<T>,
        input: &DetectionInput<'_, T>,
        (s, centre): (Vec3<T>, Vec3<T>),
        reach: T,
    ) -> T::Mask {
        let wheel = &self.parts.wheels[w];
        let origin = input.middle.origin_of(wheel.tree);
        let (radius, rounding) = (wheel.section.radius, wheel.section.rounding);
        let first = wheel.slots.start;
        let rim = LaneDisc {
            centre: origin + centre,
            axle: s,
            radius,
            rounding,
            reach,
        };
        let pieces = ground.find_pieces(w, lanes, &rim);
        let Some((pieces, known)) = pieces else {
            return lanes;
        };
        let mut rest = (lanes & !known) | (known & pieces.may_touch_others(&rim));
        let shallow = reach.like(-wheel.shallow);
        for face in pieces.faces() {
            let plane = (face.plane.normal, face.plane.height(origin));
            let stand = self.stands((w, 0), plane, input, (s, centre), reach);
            let near = lanes & stand.gap.le(reach);
            if !near.any() {
                continue;
            }
            let (t, _) = rolling(face.plane.normal, s);
            let mut low = centre + to_lowest(t, s, reach.like(radius));
            if rounding > 0.0 {
                low -= face.plane.normal * reach.like(rounding);
            }
            let low = origin + low;
            let over = near & face.admits(low);
            rest = rest | (over & stand.gap.lt(shallow));
            rest = rest | self.enter_on_plane(first, over & stand.admitted, &face.plane);
        }
        rest
    }

    /// Enters a contact with a plane into the first free one of a wheel's slots. Returns where none
    /// is.
    #[inline(always)]
    fn enter_on_plane(&mut self, first: usize, admitted: T::Mask, plane: &LanePlane<T>) -> T::Mask {
        let end = self.parts.wheels[self.part_of[first]].slots.end;
        let mut rest = admitted;
        for slot in &mut self.slots[first..end] {
            let here = rest & !slot.active;
            rest = rest & slot.active;
            if here.any() {
                slot.active = slot.active | here;
                slot.plane.normal = Vec3::select(here, plane.normal, slot.plane.normal);
                slot.plane.offset = T::select(here, plane.offset, slot.plane.offset);
            }
        }
        rest
    }
}
