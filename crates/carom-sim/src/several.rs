use crate::error::SimError;
use crate::simulate::Run;
use crate::space::Space;
impl<A: Space> Run<'_, '_, A> {
    pub fn several_contacts(&mut self) -> Result<(), SimError> {
        unimplemented!()
    }
    pub fn several_impacts(&mut self, _: &[usize]) -> Result<(), SimError> {
        unimplemented!()
    }
}
