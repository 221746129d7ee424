// The camera's picture at the current time, where the recording has one.

const element = (id) => document.getElementById(id);

export class Camera {
  constructor(recording) {
    this.has = recording.has_camera;
    this.asked = -1;
    element('camera').hidden = !this.has;
  }

  async show(frame) {
    if (!this.has || frame === this.asked) return;
    this.asked = frame;
    const answer = await fetch(`camera/${frame}`).catch(() => null);
    if (!answer?.ok || this.asked !== frame) return;
    const image = element('camera-image');
    const before = image.src;
    image.src = URL.createObjectURL(await answer.blob());
    if (before.startsWith('blob:')) URL.revokeObjectURL(before);
  }
}
