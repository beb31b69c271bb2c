"""What the simulators share: Bullet client, scene, casters, grip, sensors, concealed effects."""
