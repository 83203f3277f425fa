//! Lights drawn on maps.
