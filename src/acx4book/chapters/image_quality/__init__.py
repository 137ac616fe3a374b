"""Chapter 10, how true the synthetic image is: points against an ideal picture (section 4.1).

`known_exposure` simulates an exposure whose every pixel is known; `deviations` and `examined`
measure its synthetic image, `seams` the places where two heads meet; `one_camera` fits one
lens to what the heads leave; `tables` and `figures` show
them.
"""
