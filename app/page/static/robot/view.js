// The scene: table, board, pieces and arm in the robot's base frame, drawn only when something has changed.

import {
  BoxGeometry,
  CircleGeometry,
  DirectionalLight,
  Group,
  HemisphereLight,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  MeshPhongMaterial,
  NeutralToneMapping,
  PCFShadowMap,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  Vector3,
  WebGLRenderer,
} from '../vendor/three/three.module.js';
import {Arm} from './arm.js';
import {boardTexture, coordinateTexture, fadeTexture, makeMaterials} from './materials.js';
import {ForceArrow, Path} from './path.js';
import {Pieces} from './pieces.js';

const FRAME = 1000 / 30; // [ms] no picture comes sooner after another …
const SLOW_FRAME = 1000 / 8; // … and where there is no graphics card
const SHADOWS = 500; // [ms] between two drawings of the shadows without a graphics card
const FLOOR = {light: '#bcc6cf', dark: '#27292c'};

/** What there is to see; `render` draws it. Throws where the browser has no WebGL. */
export class View {
  constructor(canvas, description) {
    this.software = drawnBySoftware();
    this.frame = this.software ? SLOW_FRAME : FRAME;
    this.renderer = new WebGLRenderer({canvas, antialias: !this.software, alpha: true, powerPreference: 'low-power'});
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(38, 1.6, 0.03, 12);
    this.materials = makeMaterials();
    // three's world has y up and the person at +z; the base frame has z₃ down and the person at +y: this turn, once
    this.base = new Group();
    this.base.rotation.x = Math.PI / 2;
    this.scene.add(this.base);
    this.#light();
    const {table} = description;
    this.board = new Group();
    this.board.matrixAutoUpdate = false;
    this.board.matrix.copy(new Matrix4().set(...table.pose.flat()));
    this.base.add(this.board);
    this.#table(table);
    this.arm = new Arm(description, this.materials);
    this.base.add(this.arm.group);
    this.pieces = new Pieces(description, this.materials.piece);
    this.board.add(this.pieces.group);
    this.path = new Path();
    this.force = new ForceArrow();
    this.base.add(this.path.group, this.force.group);
    this.scene.updateMatrixWorld(true);
    this.toBoard = this.board.matrix.clone().invert();
    this.renders = 0;
    this.stale = true; // the shadows
    this.shadowed = -Infinity; // when they were drawn
    this.pose(description.home);
  }

  #light() {
    this.sky = new HemisphereLight('#ffffff', '#a89a86', 1.35);
    const fill = new DirectionalLight('#dfe9ff', 0.5);
    fill.position.set(0.9, 0.5, -0.5);
    this.scene.add(this.sky, fill);
    const sun = new DirectionalLight('#fff2e0', 2.3);
    sun.position.set(-0.55, 1.1, 0.6);
    sun.target.position.set(0, -0.47, 0);
    sun.castShadow = true;
    const size = this.software ? 1024 : 2048;
    sun.shadow.mapSize.set(size, size);
    Object.assign(sun.shadow.camera, {left: -0.62, right: 0.62, top: 0.62, bottom: -0.62, near: 0.4, far: 2.6});
    sun.shadow.normalBias = 0.0012;
    sun.shadow.bias = -0.0004;
    sun.shadow.radius = 3;
    this.scene.add(sun, sun.target);
  }

  #table(table) {
    const [x, y] = table.half;
    const add = (geometry, material, z, shadow = true) => {
      const mesh = new Mesh(geometry, material);
      mesh.position.z = z;
      mesh.receiveShadow = shadow;
      this.board.add(mesh);
      return mesh;
    };
    this.floor = new MeshLambertMaterial({color: FLOOR.light, transparent: true, alphaMap: fadeTexture(256, 0.42)});
    add(new CircleGeometry(1.05, 64), this.floor, -0.006);
    add(new BoxGeometry(2 * x, 2 * y, 0.006), this.materials.rim, -0.0032);
    const wood = new MeshPhongMaterial({map: boardTexture(1024), specular: '#333333', shininess: 35});
    add(new PlaneGeometry(8 * table.square, 8 * table.square), wood, 0);
    const letters = new MeshBasicMaterial({map: coordinateTexture(table.half, table.square, 1024), transparent: true});
    add(new PlaneGeometry(2 * x, 2 * y), letters, 0.0001, false);
    const disc = new CircleGeometry(table.place_radius, 28);
    for (const [name, [px, py]] of Object.entries(table.places)) {
      if (/^[LR]/.test(name)) add(disc, this.materials.place, 0.0002).position.set(px, py, 0.0002);
    }
    for (const box of table.boxes) this.#box(box);
  }

  #box({at: [x, y], half: [half_x, half_y], height, wall}) {
    const side = (size, position) => {
      const mesh = new Mesh(new BoxGeometry(...size), this.materials.box);
      mesh.position.set(...position);
      mesh.castShadow = mesh.receiveShadow = true;
      this.board.add(mesh);
    };
    for (const sign of [-1, 1]) {
      side([wall, 2 * (half_y + wall), height], [x + sign * (half_x + wall / 2), y, height / 2]);
      side([2 * half_x, wall, height], [x, y + sign * (half_y + wall / 2), height / 2]);
    }
    const lining = new Mesh(new PlaneGeometry(2 * half_x, 2 * half_y), this.materials.lining);
    lining.position.set(x, y, 0.003);
    lining.receiveShadow = true;
    this.board.add(lining);
  }

  /** Light or dark surroundings. */
  theme(dark) {
    this.floor.color.set(dark ? FLOOR.dark : FLOOR.light);
    this.sky.intensity = dark ? 1.15 : 1.55;
  }

  /** Moves arm, held piece, force and the executed part of the path. */
  pose({angles, tool, finger, force, executed, motion}) {
    this.arm.pose(angles, tool, finger);
    this.pieces.carry(this.inBoard(tool));
    if (force) this.force.show(tool, force);
    if (motion !== undefined) this.path.execute(motion === this.path.motion ? executed : motion > 0 ? 0 : Infinity);
  }

  /** A point of the base frame in the board's. */
  inBoard(point) {
    return new Vector3(...point).applyMatrix4(this.toBoard).toArray();
  }

  /** Another size of the picture [CSS pixels]. */
  resize(width, height) {
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /**
   * Draws. Shadows are drawn anew only if what throws them has moved, and without a graphics card no more often than twice a
   * second; returns whether they wait for that.
   */
  render(moved) {
    this.arm.seeThrough(this.camera);
    const now = performance.now();
    this.stale ||= moved || this.renders === 0;
    const due = this.stale && (!this.software || now - this.shadowed > SHADOWS);
    if (due) {
      this.stale = false;
      this.shadowed = now;
    }
    this.renderer.shadowMap.needsUpdate = due;
    this.renderer.render(this.scene, this.camera);
    this.renders += 1;
    return this.stale;
  }

  dispose() {
    this.scene.traverse((one) => one.geometry?.dispose());
    this.pieces.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

let software = null;

/** Whether there is no graphics card: then everything is drawn by the processor that the robot may need. */
function drawnBySoftware() {
  if (software === null) {
    const gl = document.createElement('canvas').getContext('webgl2');
    const names = gl?.getExtension('WEBGL_debug_renderer_info') ?? null;
    software = names !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
    gl?.getExtension('WEBGL_lose_context')?.loseContext();
  }
  return software;
}
