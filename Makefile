# make install   what the build needs from the system, then the program `lightcast` where cargo puts programs;
#                with FEATURES=april-grid it also finds AprilGrids in photographs
# make demo      replays the bundled sequence; light lists, pictures and rendered frames in demo/
# make test      formatting, lints, documentation, all tests
# make test-camera  the camera against real kernel drivers, in an emulated guest; part of make test
# make test-camera-broken  shows that each of these checks fails when the product is broken in a copy
# make fuzz      ten million damaged messages for all decoders of the protocol; part of make test with fewer
# make soak      ten minutes of a raw camera of 1024 x 1024 at 60 frames per second, recorded too
# make soak-clients  an hour of clients that come and go: memory, file handles and threads of the service
# make attack    bounded attacks on a service on this machine, by idle, slow and rude clients, as a table
# make load      a thousand clients at 25 lists per second: age of the lists, processor time, memory
# make bench     speed of every step, as a table with the published figures beside it
# make bench-peers  speed and error beside OpenCV, NumPy, SciPy, Mitsuba and OpenEXR (needs Python with venv)
# make cost      cost against map size and number of lights, as a table and as the plot in docs/pictures
# make report    error against time on the real maps: a page, plots and JSON in target/report
# make tables    error of the lights on the real maps, as tables beside the published figures
# make pictures  error of rendered pictures against the number of lights, as tables and as a plot
# make speed     speed of the renderer on whatever adapter there is, as tables
# make stability the hard cases in plain f32, in this program and in f64
# make path-tracer  compares the renderer with mitsuba (needs Python with venv)
# make results   writes sections of docs/results.md anew: all that need no network and no hours, or those
#                of SECTIONS="bench cost"
#
# report, tables, pictures and path-tracer need the maps and meshes (see LIGHTCAST_DATA in
# docs/contributing.md), speed takes the maps where they are. pictures, speed and path-tracer take minutes
# without a GPU.

CARGO_FLAGS = --locked
DATA = $(or $(LIGHTCAST_DATA),../shared/data)

.PHONY: install demo test test-camera test-camera-broken fuzz soak soak-clients attack load bench bench-peers cost report tables stability pictures speed path-tracer results system-packages test-packages

system-packages:
	@.ci/system-packages

test-packages:
	@.ci/system-packages test

install: system-packages
	cargo install $(CARGO_FLAGS) $(if $(FEATURES),--features $(FEATURES)) --path .

# One sample a pixel and four comparisons a shadow: on two cores without a GPU the frames take seconds in place
# of minutes.
demo: system-packages
	cargo build $(CARGO_FLAGS) --release
	@mkdir -p demo
	@rm -f demo/lights.jsonl demo/map_*.png demo/scene_*.png demo/frame_*.png
	target/release/lightcast run --config config/replay.toml --output demo/lights.jsonl --pictures demo --picture-every 20
	target/release/lightcast render config/replay.toml --output demo --every 20 --samples 1 --soft-samples 4
	@echo
	@echo "Look at these, in the folder demo/; a number is that of a list, its \"sequence\":"
	@echo "  lights.jsonl     the lights, one list a line"
	@echo "  map_NUMBER.png   the map of the surroundings, with a ring around every light:" $$(cd demo && ls map_*)
	@echo "  scene_NUMBER.png a sphere under these lights (left) and under every pixel of the map (right)"
	@echo "  frame_NUMBER.png the built-in scene as the renderer draws it under the same lights"

test: test-packages
	cargo fmt --all --check
	cargo clippy $(CARGO_FLAGS) --workspace --all-targets --features april-grid -- -D warnings
	cargo clippy $(CARGO_FLAGS) --workspace --all-targets --no-default-features -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc $(CARGO_FLAGS) --workspace --features april-grid --no-deps
	cargo test $(CARGO_FLAGS) --workspace --features april-grid
	@for example in panorama filtered_lights fisheye; do \
	    cargo run $(CARGO_FLAGS) --quiet --package lightcast-core --example $$example || exit 1; \
	done
	$(MAKE) --no-print-directory test-camera

# One check alone: tests/camera_guest/boot NAME
test-camera: test-packages
	tests/camera_guest/boot

# One patch alone: tests/camera_guest/broken/run NAME
test-camera-broken: test-packages
	tests/camera_guest/broken/run

fuzz: system-packages
	LIGHTCAST_FUZZ_INPUTS=10000000 cargo test $(CARGO_FLAGS) --release --test corrupt_messages -- --nocapture

soak: system-packages
	rm -rf target/soak
	cargo bench $(CARGO_FLAGS) --bench soak -- 600 target/soak

soak-clients: test-packages
	LIGHTCAST_SOAK_S=3600 cargo test $(CARGO_FLAGS) --test serve -- --nocapture clients_that_come_and_go

attack: system-packages
	cargo build $(CARGO_FLAGS) --release
	python3 tests/attack/attack.py target/release/lightcast

load: system-packages
	cargo bench $(CARGO_FLAGS) --bench load

bench: system-packages
	cargo bench $(CARGO_FLAGS) --bench steps

PEERS = target/peers

bench-peers: system-packages
	cargo bench $(CARGO_FLAGS) --bench peers --no-run
	python3 -m venv $(PEERS)/venv
	$(PEERS)/venv/bin/pip install --quiet --requirement benches/peers/requirements.txt
	$(PEERS)/venv/bin/python benches/peers/compare.py --folder $(PEERS)/files -- \
	    cargo bench $(CARGO_FLAGS) --quiet --bench peers

cost: system-packages
	cargo bench $(CARGO_FLAGS) --bench steps -- --cost $(CURDIR)/docs/pictures/cost.svg

REPORTED = $(DATA)/env/*_1k.hdr \
    --garden $(DATA)/env/chinese_garden_1k.hdr --hall $(DATA)/env/dancing_hall_1k.hdr

report: system-packages
	cargo run $(CARGO_FLAGS) --release -- report --output target/report $(REPORTED)

tables: system-packages
	cargo run $(CARGO_FLAGS) --release -- report --tables --lights 64,256 $(REPORTED)

stability: system-packages
	cargo run $(CARGO_FLAGS) --release -- report --stability

PATH_TRACER = target/path_tracer

path-tracer: system-packages
	cargo build $(CARGO_FLAGS) --release
	python3 -m venv $(PATH_TRACER)/venv
	$(PATH_TRACER)/venv/bin/pip install --quiet numpy mitsuba==3.9.1
	@for map in studio_small_03 noon_grass; do \
	    echo "$$map"; \
	    $(PATH_TRACER)/venv/bin/python tests/path_tracer/compare.py --map $(DATA)/env/$${map}_1k.hdr \
	        --mesh $(DATA)/mesh/spot.obj --output $(PATH_TRACER)/$$map || exit 1; \
	done

pictures: system-packages
	cargo run $(CARGO_FLAGS) --release -- report-pictures $(DATA)/env/studio_small_03_1k.hdr \
	    $(DATA)/env/noon_grass_1k.hdr $(DATA)/env/dancing_hall_1k.hdr $(DATA)/env/potsdamer_platz_1k.hdr \
	    --scene $(DATA)/mesh/bunny.glb --scene $(DATA)/mesh/spot.obj --plot docs/pictures/error.svg

speed: system-packages
	cargo run $(CARGO_FLAGS) --release -- report-speed \
	    $(wildcard $(DATA)/env/studio_small_03_1k.hdr $(DATA)/env/noon_grass_1k.hdr)

SECTIONS = tables stability bench cost pictures speed load

results:
	docs/renew $(SECTIONS)
