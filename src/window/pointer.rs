use super::orbit::Orbit;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};

/// Pixels of touch-pad scrolling that equal one notch of a wheel.
const PX_PER_NOTCH: f64 = 40.0;

/// State of the pointer.
#[derive(Debug, Default)]
pub(super) struct Pointer {
    held: Option<MouseButton>,
    at_px: [f64; 2],
    is_shift_held: bool,
}

impl Pointer {
    /// Moves `orbit` according to a drag or the wheel in a window `height_px` high; returns whether it moved.
    pub fn follow(&mut self, event: &WindowEvent, orbit: &mut Orbit, height_px: u32) -> bool {
        match *event {
            WindowEvent::ModifiersChanged(modifiers) => {
                self.is_shift_held = modifiers.state().shift_key();
                false
            }
            WindowEvent::MouseInput { state, button, .. } => {
                self.held = (state == ElementState::Pressed).then_some(button);
                false
            }
            WindowEvent::CursorMoved { position, .. } => {
                let last = std::mem::replace(&mut self.at_px, [position.x, position.y]);
                let by = [position.x - last[0], position.y - last[1]];
                match (self.held, self.is_shift_held) {
                    (Some(MouseButton::Left), false) => orbit.turn(by, height_px),
                    (Some(MouseButton::Left), true) | (Some(MouseButton::Right), _) => {
                        orbit.pan(by, height_px);
                    }
                    _ => return false,
                }
                true
            }
            WindowEvent::MouseWheel { delta, .. } => {
                orbit.zoom(match delta {
                    MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
                    MouseScrollDelta::PixelDelta(position) => position.y / PX_PER_NOTCH,
                });
                true
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Bounds, Camera};
    use winit::dpi::PhysicalPosition;
    use winit::event::DeviceId;
    use winit::keyboard::ModifiersState;

    fn to(x: f64, y: f64) -> WindowEvent {
        WindowEvent::CursorMoved { device_id: DeviceId::dummy(), position: PhysicalPosition::new(x, y) }
    }

    fn button(state: ElementState, button: MouseButton) -> WindowEvent {
        WindowEvent::MouseInput { device_id: DeviceId::dummy(), state, button }
    }

    #[test]
    fn buttons_and_shift_say_what_a_drag_does() {
        let first = Orbit::new(&Camera::framing(&Bounds::EMPTY, 1.0));
        for (held, modifiers, is_turn) in [
            (MouseButton::Left, ModifiersState::empty(), true),
            (MouseButton::Left, ModifiersState::SHIFT, false),
            (MouseButton::Right, ModifiersState::empty(), false),
            (MouseButton::Right, ModifiersState::SHIFT, false),
        ] {
            let (mut pointer, mut orbit, mut expected) = (Pointer::default(), first, first);
            let mut follow = |event: WindowEvent| pointer.follow(&event, &mut orbit, 200);
            assert!(!follow(to(30.0, 40.0)), "nothing is held");
            assert!(!follow(WindowEvent::ModifiersChanged(modifiers.into())));
            assert!(!follow(button(ElementState::Pressed, held)));
            assert!(follow(to(33.0, 35.0)));
            assert!(!follow(button(ElementState::Released, held)));
            assert!(!follow(to(90.0, 90.0)));
            if is_turn {
                expected.turn([3.0, -5.0], 200)
            } else {
                expected.pan([3.0, -5.0], 200)
            }
            assert_eq!(orbit, expected, "{held:?} {modifiers:?}");
        }
    }

    #[test]
    fn the_wheel_and_a_touch_pad_go_nearer() {
        let first = Orbit::new(&Camera::framing(&Bounds::EMPTY, 1.0));
        let mut expected = first;
        expected.zoom(2.0);
        for delta in [
            MouseScrollDelta::LineDelta(0.0, 2.0),
            MouseScrollDelta::PixelDelta(PhysicalPosition::new(5.0, 2.0 * PX_PER_NOTCH)),
        ] {
            let mut orbit = first;
            let event = WindowEvent::MouseWheel {
                device_id: DeviceId::dummy(),
                delta,
                phase: winit::event::TouchPhase::Moved,
            };
            assert!(Pointer::default().follow(&event, &mut orbit, 200));
            assert_eq!(orbit, expected);
        }
    }
}
